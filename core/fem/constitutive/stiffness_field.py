"""How stiff the body is from place to place: lumps, a skin on top, and a change through the
height."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Inclusion, Layer, Material

__all__ = [
    "Spots",
    "SurfaceQuadrature",
    "layer_share",
    "log_stiffness",
    "lump_share",
    "surface_stiffness",
]


class Spots(Protocol):
    """Points of the body at rest, and how large the part is that each stands for."""

    @property
    def places(self) -> FloatArray:
        """(..., 3) [m]."""

    @property
    def edges(self) -> FloatArray:
        """(...) [m]."""


@dataclass(frozen=True, eq=False)
class SurfaceQuadrature:
    """Points of the surface at rest (f, p, 3) [m], and the edge of the part of it that each stands
    for (f, p) [m].
    """

    places: FloatArray
    edges: FloatArray


_EDGE = 2.3
"""So many edges from its surface a lump or skin holds less than a ten-thousandth of a point's
volume."""


@njit(cache=True)
def _inside(depth: float, edge: float) -> float:
    """Share of a point's volume on the inner side of a surface that lies `depth` [m] outwards of
    the point.

    A point stands for the volume around it, which the surface cuts while it passes over about an
    edge's length; the share is smooth, and so is all that follows from it.
    """
    edges = depth / edge
    return 0.5 * (1 + math.tanh(2 * edges)) if edges > -_EDGE else 0.0


@njit(cache=True)
def _in_ball(places: Any, edges: Any, x: float, y: float, z: float, radius: float) -> Any:
    """Share (m,) of the points at places (m, 3) within a ball; a diagnosis asks for those of
    hundreds in every frame.
    """
    found = np.empty(len(places))
    for m in range(len(places)):
        apart = math.sqrt(
            (places[m, 0] - x) ** 2 + (places[m, 1] - y) ** 2 + (places[m, 2] - z) ** 2
        )
        found[m] = _inside(radius - apart, edges[m])
    return found


@njit(cache=True)
def _above(heights: Any, edges: Any, least: float) -> Any:
    """Share (m,) of the points at these heights (m,) above the least [m]."""
    found = np.empty(len(heights))
    for m in range(len(heights)):
        found[m] = _inside(heights[m] - least, edges[m])
    return found


def lump_share(lump: Inclusion, spots: Spots) -> FloatArray:
    """Share (...) of the volume of each point that the lump holds [1]."""
    edges = spots.edges
    share = _in_ball(
        spots.places.reshape(-1, 3), edges.ravel(), lump.x, lump.y, lump.z, lump.radius
    )
    return np.asarray(share.reshape(edges.shape))


def layer_share(layer: Layer, spots: Spots, height: float) -> FloatArray:
    """Share (...) of the volume of each point that the skin on top of a body of this height [m]
    holds [1].
    """
    edges = spots.edges
    share = _above(
        np.ascontiguousarray(spots.places[..., 2]).ravel(), edges.ravel(), height - layer.thickness
    )
    return np.asarray(share.reshape(edges.shape))


def log_stiffness(material: Material, spots: Spots, height: float) -> FloatArray:
    """Logarithm (...) of the stiffness at these points over the stated one [1]."""
    log_factor = material.log_ratio * (spots.places[..., 2] / height - 0.5)
    for lump in material.inclusions:
        log_factor += lump_share(lump, spots) * np.log(lump.stiffness_ratio)
    if material.layer is not None:
        log_factor += layer_share(material.layer, spots, height) * np.log(
            material.layer.stiffness_ratio
        )
    return np.asarray(log_factor)


def surface_stiffness(material: Material, spots: Spots, height: float) -> FloatArray:
    """How hard the surface resists a push (...), over E [1]: what a contact's penalty must go with,
    or a hard skin is pushed into.

    Never below one, since under a soft skin lies what is not. Fibres in the plane share a push with
    the matrix around them.
    """
    fibres = 1.0 if material.fibres is None else np.sqrt(material.fibres.stiffness_ratio)
    return np.asarray(fibres * np.exp(np.maximum(log_stiffness(material, spots, height), 0.0)))
