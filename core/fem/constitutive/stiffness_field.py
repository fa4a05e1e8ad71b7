"""Stiffness from place to place: inclusions, a skin, and a gradient through the height."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray, lengths
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import AnyInclusion, Layer, Material

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
def _around(places: Any, edges: Any, line: Any, ways: Any, arch: float, radius: float) -> Any:
    """Share (m,) of the volume of points at places (m, 3) within a radius of a line (k, 3).

    A diagnosis computes this for hundreds of balls, lines of one point, in every frame. Places too
    far from the chord, which the line leaves by `arch` [m] at most, are not compared with the rest.

    Args:
        places: rest positions [m].
        edges: edge lengths of their parts (m,) [m].
        line: points [m].
        ways: (k, 4) vectors of the chord and from each point to the next [m], with one over their
            squared lengths; none (0, 4) for one point.
        arch: [m].
        radius: [m].
    """
    result = np.zeros(len(places))
    x, y, z, count = line[0, 0], line[0, 1], line[0, 2], len(ways)
    for m in range(len(places)):
        dx, dy, dz = places[m, 0] - x, places[m, 1] - y, places[m, 2] - z
        least = dx**2 + dy**2 + dz**2
        reach = radius + _EDGE * edges[m] + arch
        for k in range(count):
            ax, ay, az = ways[k, 0], ways[k, 1], ways[k, 2]
            share = min(max((dx * ax + dy * ay + dz * az) * ways[k, 3], 0.0), 1.0)
            off = (dx - share * ax) ** 2 + (dy - share * ay) ** 2 + (dz - share * az) ** 2
            if k == 0:
                if arch == 0.0 or off > reach**2:
                    least = off
                    break
            else:
                least = min(least, off)
                dx, dy, dz = dx - ax, dy - ay, dz - az
        if least < reach**2:
            result[m] = _inside(radius - math.sqrt(least), edges[m])
    return result


@njit(cache=True)
def _within(depths: Any, edges: Any, most: float) -> Any:
    """Share (m,) of the volume of points at these depths (m,) above `most` [m]."""
    result = np.empty(len(depths))
    for m in range(len(depths)):
        result[m] = _inside(most - depths[m], edges[m])
    return result


def lump_share(lump: AnyInclusion, points: SamplePoints) -> FloatArray:
    """Share (...) of each point's volume within the inclusion [1]."""
    edges, line = points.edges, np.array(lump.polyline)
    chord = line[-1:] - line[:1]
    ways = np.concatenate([chord, np.diff(line, axis=0)])[: 0 if len(line) == 1 else None]
    ways = np.column_stack([ways, 1.0 / np.maximum((ways**2).sum(axis=1), 1e-30)])
    away = line[1:-1] - line[0]
    along = np.clip(away @ ways[0, :3] * ways[0, 3], 0.0, 1.0)[:, None] if len(away) else away
    arch = float(lengths(away - along * chord).max(initial=0.0)) if len(away) else 0.0
    share = _around(points.places.reshape(-1, 3), edges.ravel(), line, ways, arch, lump.radius)
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
