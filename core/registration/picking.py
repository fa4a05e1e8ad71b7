"""Which point of a cloud or a mesh a ray from the eye means."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.registration.faces import IndexArray

__all__ = ["pick_cloud", "pick_mesh", "slide_on_cloud"]

NEAR, WIDEST = 1.5, 6.0
"""Points within so many pixels of the ray are candidates; the reach doubles up to the second where
there are none."""
AROUND = 12
"""Points that tell how the surface lies at one of them."""
GAP = 5.0e-3
"""Candidates further apart along the ray than this [m] belong to different surfaces."""


def pick_cloud(
    points: FloatArray, origin: FloatArray, direction: FloatArray, pixel: float
) -> int | None:
    """Row of the point (n, 3) [m] that a ray (3,), (3,) means; `pixel` is the angle of one pixel
    [rad]. None beside the cloud.

    Of the points near the ray the front-most cluster counts, and of it the point nearest to the
    ray. All in one frame. The ray is that through the pixel's centre, (u + 0.5, v + 0.5).
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
    """Where a ray first meets the triangles (m, 3) over vertices (n, 3) [m]; (3,) [m], or None
    (Moeller and Trumbore 1997).
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
    """Where a ray meets the plane through the points (n, 3) [m] around `start` (3,): (3,) [m].

    So a pick is moved by less than the points are apart. None where the ray runs along that plane.
    All in one frame.
    """
    apart = np.linalg.norm(points - start, axis=1)
    around = points[np.argsort(apart)[:AROUND]]
    centre = around.mean(axis=0)
    normal = np.linalg.svd(around - centre)[2][2]
    slope = float(normal @ direction)
    if abs(slope) < 0.05 * float(np.linalg.norm(direction)):
        return None
    return np.asarray(origin + direction * float(normal @ (centre - origin)) / slope)
