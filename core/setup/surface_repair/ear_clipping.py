"""Triangulation of a simple polygon in the plane."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["clip_ears"]


@njit(cache=True)
def _across(a: Any, b: Any, c: Any) -> float:
    """Twice the signed area of a triangle in the plane."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


@njit(cache=True)
def _quality(places: Any, before: Any, after: Any, i: int) -> float:
    """Area over the squared longest side of the ear at corner i [1]; -1 where it is none."""
    a, b, c = places[before[i]], places[i], places[after[i]]
    area = _across(a, b, c)
    longest = max(np.sum((b - a) ** 2), np.sum((c - b) ** 2), np.sum((a - c) ** 2))
    if area <= 1e-12 * longest:
        return -1.0
    k = after[after[i]]
    while k != before[i]:
        p = places[k]
        if _across(a, b, p) >= 0 and _across(b, c, p) >= 0 and _across(c, a, p) >= 0:
            same = False
            for q in (a, b, c):
                same = same or (p[0] == q[0] and p[1] == q[1])
            if not same:
                return -1.0
        k = after[k]
    return float(area / longest)


@njit(cache=True)
def _clipped(places: Any) -> Any:
    """Triangles (n - 2, 3) of a polygon; fewer where it is not simple."""
    count = len(places)
    before, after = np.empty(count, np.int64), np.empty(count, np.int64)
    for i in range(count):
        before[i], after[i] = (i - 1) % count, (i + 1) % count
    quality = np.empty(count)
    for i in range(count):
        quality[i] = _quality(places, before, after, i)
    triangles = np.empty((count - 2, 3), np.int64)
    for made in range(count - 2):
        best = int(np.argmax(quality))
        if quality[best] <= 0:
            return triangles[:made]
        a, c = before[best], after[best]
        triangles[made] = (a, best, c)
        after[a], before[c], quality[best] = c, a, -2.0
        # Only ears that had the clipped corner inside or beside them change.
        for i in range(count):
            if quality[i] > -2.0 and (i in (a, c) or quality[i] == -1.0):
                quality[i] = _quality(places, before, after, i)
    return triangles


def clip_ears(places: FloatArray) -> IntArray | None:
    """Triangulate a simple polygon, its best ears first (Meisters 1975); None where it crosses
    itself.

    Args:
        places: (n, 2) corners, counter-clockwise, none of them twice.

    Returns:
        (n - 2, 3) corners of the triangles, counter-clockwise.
    """
    triangles = _clipped(np.ascontiguousarray(places, dtype=float))
    return np.asarray(triangles) if len(triangles) == len(places) - 2 else None
