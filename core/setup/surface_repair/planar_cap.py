"""Triangles within rims in a plane, of which some may lie inside others."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.setup.surface_repair.ear_clipping import clip_ears

__all__ = ["cap_rims", "signed_area"]

_TRIED = 400
"""Bridges from a hole to the rim around it that are tried, the shortest first."""


def cap_rims(places: FloatArray, rims: Sequence[IntArray]) -> IntArray | None:
    """Triangles (c, 3) within rims (k,), which run against them; None where rims cross.

    Rims turn one way around the inside and the other way around holes within it, as the edges of
    an oriented surface do.

    Args:
        places: (n, 2) vertices in the plane [m].
        rims: vertices of each rim in the direction of the surface's triangles.
    """
    areas = [signed_area(places[rim]) for rim in rims]
    if areas[int(np.argmax(np.abs(areas)))] < 0:
        places, areas = places * (-1.0, 1.0), [-area for area in areas]
    order = np.argsort([-abs(area) for area in areas])
    polygons = [rims[number] for number in order if areas[number] > 0]
    sizes = [areas[number] for number in order if areas[number] > 0]
    outlines = list(polygons)
    for number in order:
        if areas[number] > 0:
            continue
        around = [
            place
            for place, outline in enumerate(outlines)
            if sizes[place] > -areas[number] and _contains(places[outline], places[rims[number]])
        ]
        joined = _bridged(places, polygons[around[-1]], rims[number]) if around else None
        if joined is None:
            return None
        polygons[around[-1]] = joined
    made = []
    for polygon in polygons:
        ears = clip_ears(places[polygon])
        if ears is None:
            return None
        made.append(polygon[ears][:, ::-1])
    return np.concatenate(made)


def signed_area(places: FloatArray) -> float:
    """Area of a polygon (k, 2), positive counter-clockwise."""
    x, y = (places - places.mean(axis=0)).T
    return float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y) / 2)


def _contains(polygon: FloatArray, points: FloatArray) -> bool:
    """Whether most of some points (m, 2) lie in a polygon (k, 2), by the parity of crossings."""
    (x, y), (u, v) = polygon.T, np.roll(polygon, -1, axis=0).T
    count = 0
    for px, py in points:
        spans = (y > py) != (v > py)
        at = x[spans] + (py - y[spans]) / (v[spans] - y[spans]) * (u[spans] - x[spans])
        count += int((at > px).sum()) % 2
    return 2 * count > len(points)


def _bridged(places: FloatArray, polygon: IntArray, hole: IntArray) -> IntArray | None:
    """A polygon that runs to a hole, around it and back; None where no bridge is free."""
    outer, inner = places[polygon], places[hole]
    apart = np.linalg.norm(outer[:, None] - inner, axis=2)
    for pair in np.argsort(apart, axis=None, kind="stable")[:_TRIED]:
        one, other = (int(index) for index in np.unravel_index(pair, apart.shape))
        if not any(_cut(outer[one], inner[other], ring).any() for ring in (outer, inner)):
            there = np.roll(hole, -other)
            return np.concatenate([polygon[: one + 1], there, there[:1], polygon[one:]])
    return None


def _cut(start: FloatArray, end: FloatArray, ring: FloatArray) -> BoolArray:
    """Mark sides (k,) of a ring that cross a segment; sides that begin or end on its ends do
    not.
    """
    first, second = ring, np.roll(ring, -1, axis=0)

    def turn(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        return np.asarray(
            (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
            - (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
        )

    own = turn(first, second, start) * turn(first, second, end)
    other = turn(start, end, first) * turn(start, end, second)
    return np.asarray((own < 0) & (other < 0))
