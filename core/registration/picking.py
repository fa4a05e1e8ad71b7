"""Picking of points of a cloud or a mesh by a ray from the eye."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.registration.faces import IndexArray

__all__ = ["pick_cloud", "pick_mesh", "slide_on_cloud"]

NEAR, WIDEST = 1.5, 6.0
"""Radius around the ray in which points are candidates [pixels]; it doubles up to the second value
while there are none."""
AROUND = 12
"""Number of points that determine the tangent plane."""
GAP = 5.0e-3
"""Distance along the ray that separates candidates of different surfaces [m]."""


def pick_cloud(
    points: FloatArray, origin: FloatArray, direction: FloatArray, pixel: float
) -> int | None:
    """Row of the picked point; None beside the cloud.

    It is the point nearest to the ray in the front-most cluster near the ray. All arguments are in
    one frame.

    Args:
        points: (n, 3) [m].
        origin: (3,) of the ray [m].
        direction: (3,) of the ray, through the pixel's centre (u + 0.5, v + 0.5).
        pixel: angle of one pixel [rad].
    """
    direction = direction / np.linalg.norm(direction)
    arm = points - origin
    along = arm @ direction
    with np.errstate(divide="ignore", invalid="ignore"):
        across = np.linalg.norm(arm - along[:, None] * direction, axis=1) / along
    reach = NEAR * pixel
    while reach <= WIDEST * pixel:
        rows = np.flatnonzero((along > 0.0) & (across < reach))
        if len(rows):
            order = rows[np.argsort(along[rows])]
            breaks = np.flatnonzero(np.diff(along[order]) > GAP)
            front = order[: breaks[0] + 1] if len(breaks) else order
            return int(front[across[front].argmin()])
        reach *= 2.0
    return None


def pick_mesh(
    vertices: FloatArray, faces: IndexArray, origin: FloatArray, direction: FloatArray
) -> FloatArray | None:
    """First intersection (3,) [m] of a ray with triangles (m, 3) over vertices (n, 3) [m]; None
    without one (Moeller and Trumbore 1997).
    """
    corner = vertices[faces[:, 0]]
    first, second = vertices[faces[:, 1]] - corner, vertices[faces[:, 2]] - corner
    side = np.cross(direction, second)
    determinant = (first * side).sum(axis=1)
    arm = origin - corner
    turned = np.cross(arm, first)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (arm * side).sum(axis=1) / determinant, turned @ direction / determinant
        along = (second * turned).sum(axis=1) / determinant
        edge = 1.0e-9
        hit = (
            (np.abs(determinant) > 1e-18)
            & (u >= -edge)
            & (v >= -edge)
            & (u + v <= 1 + edge)
            & (along > 0.0)
        )
    return np.asarray(origin + along[hit].min() * direction) if hit.any() else None


def slide_on_cloud(
    points: FloatArray, start: FloatArray, origin: FloatArray, direction: FloatArray
) -> FloatArray | None:
    """Intersection (3,) [m] of a ray with the tangent plane of the points (n, 3) [m] at `start`.

    A pick can thus be moved by less than the distance of points. None for a ray along the plane.
    All arguments are in one frame.
    """
    apart = np.linalg.norm(points - start, axis=1)
    around = points[np.argsort(apart)[:AROUND]]
    centre = around.mean(axis=0)
    normal = np.linalg.svd(around - centre)[2][2]
    slope = float(normal @ direction)
    if abs(slope) < 0.05 * float(np.linalg.norm(direction)):
        return None
    return np.asarray(origin + direction * float(normal @ (centre - origin)) / slope)
