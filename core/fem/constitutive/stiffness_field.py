"""Stiffness from place to place: inclusions, a skin, and a gradient through the height."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Inclusion, Layer, Material

__all__ = [
    "SamplePoints",
    "SurfaceQuadrature",
    "layer_share",
    "log_stiffness",
    "lump_share",
    "surface_stiffness",
]


class SamplePoints(Protocol):
    """Points of the body at rest, and the size of the part that each represents."""

    @property
    def places(self) -> FloatArray:
        """Rest positions (..., 3) [m]."""

    @property
    def edges(self) -> FloatArray:
        """Edge lengths of the parts (...) [m]."""


@dataclass(frozen=True, eq=False)
class SurfaceQuadrature:
    """Quadrature points of the surface at rest.

    Attributes:
        places: (f, p, 3) [m].
        edges: (f, p) edge of the part of the surface that each represents [m].
    """

    places: FloatArray
    edges: FloatArray


_EDGE = 2.3
"""Distance from an inclusion's surface, in edges, beyond which it contains less than a
ten-thousandth of a point's volume [1]."""


@njit(cache=True)
def _inside(depth: float, edge: float) -> float:
    """Share of a point's volume on the inner side of a surface that lies `depth` [m] outwards of
    it.

    A point represents the volume around it, which the surface cuts while it moves over about an
    edge's length. The share is smooth, and so is every result.
    """
    edges = depth / edge
    return 0.5 * (1 + math.tanh(2 * edges)) if edges > -_EDGE else 0.0


@njit(cache=True)
def _in_ball(places: Any, edges: Any, x: float, y: float, z: float, radius: float) -> Any:
    """Share (m,) of the volume of points at places (m, 3) within a ball.

    A diagnosis computes this for hundreds of balls in every frame.
    """
    result = np.empty(len(places))
    for m in range(len(places)):
        apart = math.sqrt(
            (places[m, 0] - x) ** 2 + (places[m, 1] - y) ** 2 + (places[m, 2] - z) ** 2
        )
        result[m] = _inside(radius - apart, edges[m])
    return result


@njit(cache=True)
def _within(depths: Any, edges: Any, most: float) -> Any:
    """Share (m,) of the volume of points at these depths (m,) above `most` [m]."""
    result = np.empty(len(depths))
    for m in range(len(depths)):
        result[m] = _inside(most - depths[m], edges[m])
    return result


def lump_share(lump: Inclusion, points: SamplePoints) -> FloatArray:
    """Share (...) of each point's volume within the inclusion [1]."""
    edges = points.edges
    share = _in_ball(
        points.places.reshape(-1, 3), edges.ravel(), lump.x, lump.y, lump.z, lump.radius
    )
    return np.asarray(share.reshape(edges.shape))


def layer_share(layer: Layer, points: SamplePoints, geometry: Geometry) -> FloatArray:
    """Share (...) of each point's volume within the skin of a body [1]."""
    edges = points.edges
    depths = geometry.below_skin(points.places.reshape(-1, 3))
    share = _within(np.ascontiguousarray(depths), edges.ravel(), layer.thickness)
    return np.asarray(share.reshape(edges.shape))


def log_stiffness(material: Material, points: SamplePoints, geometry: Geometry) -> FloatArray:
    """Logarithm (...) of the stiffness at these points over the stated one [1]."""
    log_factor = material.log_ratio * (points.places[..., 2] / geometry.height - 0.5)
    for lump in material.inclusions:
        log_factor += lump_share(lump, points) * np.log(lump.stiffness_ratio)
    if material.layer is not None:
        log_factor += layer_share(material.layer, points, geometry) * np.log(
            material.layer.stiffness_ratio
        )
    return np.asarray(log_factor)


def surface_stiffness(material: Material, points: SamplePoints, geometry: Geometry) -> FloatArray:
    """Resistance of the surface to a push (...), over E [1].

    A contact's penalty is proportional to it; otherwise a hard skin would be penetrated. It is
    never below one, because a soft skin lies on the base material. Fibres in the plane share a push
    with the matrix around them.
    """
    fibres = 1.0 if material.fibres is None else np.sqrt(material.fibres.stiffness_ratio)
    return np.asarray(fibres * np.exp(np.maximum(log_stiffness(material, points, geometry), 0.0)))
