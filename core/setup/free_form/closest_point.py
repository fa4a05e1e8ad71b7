"""Closest points on triangles, containing tetrahedra, and winding numbers.

The kernels try all triangles or tetrahedra, which is fast enough for some thousands of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = ["containing", "nearest", "winding_number"]

_TIE = 1e-12
"""Distances that differ by less are equal [m]."""


@njit(cache=True)
def _shares(p: Any, a: Any, b: Any, c: Any) -> tuple[float, float, float]:  # noqa: PLR0911 (one for each corner, edge and the inside)
    """Barycentric coordinates of the triangle's point nearest to p.

    Source: Ericson, Real-Time Collision Detection, 2005, 5.1.5.
    """
    ab, ac, ap, bp, cp = b - a, c - a, p - a, p - b, p - c
    d1, d2, d3 = np.dot(ab, ap), np.dot(ac, ap), np.dot(ab, bp)
    d4, d5, d6 = np.dot(ac, bp), np.dot(ab, cp), np.dot(ac, cp)
    if d1 <= 0 and d2 <= 0:
        return 1.0, 0.0, 0.0
    if d3 >= 0 and d4 <= d3:
        return 0.0, 1.0, 0.0
    if d6 >= 0 and d5 <= d6:
        return 0.0, 0.0, 1.0
    vc, vb, va = d1 * d4 - d3 * d2, d5 * d2 - d1 * d6, d3 * d6 - d5 * d4
    if vc <= 0 and d1 >= 0 and d3 <= 0:
        share = d1 / (d1 - d3)
        return 1.0 - share, share, 0.0
    if vb <= 0 and d2 >= 0 and d6 <= 0:
        share = d2 / (d2 - d6)
        return 1.0 - share, 0.0, share
    if va <= 0 and d4 >= d3 and d5 >= d6:
        share = (d4 - d3) / (d4 - d3 + d5 - d6)
        return 0.0, 1.0 - share, share
    whole = va + vb + vc
    return va / whole, vb / whole, vc / whole


@njit(cache=True)
def _spheres(corners: Any) -> tuple[Any, Any]:
    """Return centres (t, 3) and radii (t,) [m] of spheres around triangles (t, 3, 3)."""
    middles, reaches = np.empty((len(corners), 3)), np.empty(len(corners))
    for t in range(len(corners)):
        for k in range(3):
            middles[t, k] = (corners[t, 0, k] + corners[t, 1, k] + corners[t, 2, k]) / 3
        most = 0.0
        for i in range(3):
            far = 0.0
            for k in range(3):
                far += (corners[t, i, k] - middles[t, k]) ** 2
            most = max(most, far)
        reaches[t] = np.sqrt(most)
    return middles, reaches


@njit(cache=True)
def nearest(points: Any, corners: Any) -> tuple[Any, Any]:
    """Find the nearest of triangles (t, 3, 3) [m] to each point (m, 3) [m].

    Of triangles that meet in the nearest place it is the one that faces the point most: its side
    tells whether the point is outside.

    Returns:
        number (m,) of the triangle, and the nearest point on it (m, 3) [m].
    """
    numbers, places = np.zeros(len(points), np.int64), np.zeros((len(points), 3))
    middles, reaches = _spheres(corners)
    for m in range(len(points)):
        best, most = np.inf, 0.0
        for t in range(len(corners)):
            far = 0.0
            for i in range(3):
                far += (points[m, i] - middles[t, i]) ** 2
            if far > (best + reaches[t]) ** 2:
                continue
            u, v, w = _shares(points[m], corners[t, 0], corners[t, 1], corners[t, 2])
            place = u * corners[t, 0] + v * corners[t, 1] + w * corners[t, 2]
            away = points[m] - place
            distance = float(np.linalg.norm(away))
            if distance > best + _TIE:
                continue
            across = np.cross(corners[t, 1] - corners[t, 0], corners[t, 2] - corners[t, 0])
            facing = abs(np.dot(away, across)) / max(float(np.linalg.norm(across)), 1e-300)
            if distance < best - _TIE or facing > most:
                best, most, numbers[m] = min(distance, best), facing, t
                places[m] = place
    return numbers, places


@njit(cache=True)
def containing(
    points: Any, lows: Any, highs: Any, origins: Any, inverses: Any, tolerance: float
) -> Any:
    """Find the tetrahedron that contains each point; -1 if none does.

    Args:
        points: (m, 3) [m].
        lows: (e, 3) lower bounds of the tetrahedra [m].
        highs: (e, 3) upper bounds [m].
        origins: (e, 3) first corners [m].
        inverses: (e, 3, 3) [1/m], which turn a vector from the origin into barycentric coordinates
            1 to 3.
        tolerance: each coordinate may be so far below zero [1].

    Returns:
        numbers (m,).
    """
    numbers = np.full(len(points), -1)
    for m in range(len(points)):
        for e in range(len(lows)):
            x, y, z = points[m]
            if (
                x < lows[e, 0]
                or y < lows[e, 1]
                or z < lows[e, 2]
                or x > highs[e, 0]
                or y > highs[e, 1]
                or z > highs[e, 2]
            ):
                continue
            dx, dy, dz = x - origins[e, 0], y - origins[e, 1], z - origins[e, 2]
            total, inside = 0.0, True
            for i in range(3):
                share = inverses[e, i, 0] * dx + inverses[e, i, 1] * dy + inverses[e, i, 2] * dz
                total += share
                inside = inside and share >= -tolerance
            if inside and total <= 1 + tolerance:
                numbers[m] = e
                break
    return numbers


@njit(cache=True)
def winding_number(faces: Any, positions: Any, point: Any) -> float:
    """Winding number of flat polygons around a point (3,): over a closed surface 1 inside, 0
    outside.

    It is the sum of the triangles' solid angles (van Oosterom and Strackee 1983) over that of the
    sphere.

    Args:
        faces: (f, 3) or (f, 4) nodes of the polygons.
        positions: (n, 3) of the nodes [m].
        point: (3,) [m].
    """
    total, arms, lengths = 0.0, np.empty((3, 3)), np.empty(3)
    for f in range(faces.shape[0]):
        for second in range(1, faces.shape[1] - 1):
            for corner, a in enumerate((0, second, second + 1)):
                for i in range(3):
                    arms[corner, i] = positions[faces[f, a], i] - point[i]
                lengths[corner] = np.sqrt(
                    arms[corner, 0] ** 2 + arms[corner, 1] ** 2 + arms[corner, 2] ** 2
                )
            a, b, c = arms[0], arms[1], arms[2]
            across = (
                a[0] * (b[1] * c[2] - b[2] * c[1])
                + a[1] * (b[2] * c[0] - b[0] * c[2])
                + a[2] * (b[0] * c[1] - b[1] * c[0])
            )
            along = lengths[0] * lengths[1] * lengths[2]
            for i in range(3):
                along += (
                    a[i] * b[i] * lengths[2] + b[i] * c[i] * lengths[0] + c[i] * a[i] * lengths[1]
                )
            total += 2 * np.arctan2(across, along)
    return total / (4 * np.pi)
