"""The table in a raw cloud: the large plane with nearly no points behind it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import RegistrationError

__all__ = ["TablePlane", "find_planes", "find_table"]

BEHIND = 5.0e-3
"""Distance behind a plane from which points count as behind it [m]."""
_DRAWS, _BATCHES = 400, 20
"""Planes that are tried, and in how many batches."""
LEAST_SHARE = 0.05
"""Least share of the points that makes a large plane [1]."""


@dataclass(frozen=True, eq=False)
class TablePlane:
    """A plane n.x = d in the camera frame.

    Attributes:
        normal: (3,) unit vector towards the camera.
        offset: d [m].
        count: number of points in the plane.
        behind: share of points behind it [1].
    """

    normal: FloatArray
    offset: float
    count: int
    behind: float

    def height(self, points: FloatArray) -> FloatArray:
        """Height (n,) [m] of points (n, 3), camera frame, over the plane."""
        return np.asarray(points @ self.normal - self.offset)


def find_planes(cloud: FloatArray, thickness: float, most: int = 4) -> list[TablePlane]:
    """Find the largest planes of a cloud (n, 3) [m], camera frame, by repeated RANSAC; points
    within `thickness` [m] belong to a plane.
    """
    planes: list[TablePlane] = []
    left, rng = cloud, np.random.default_rng(0)
    while len(planes) < most and len(left) >= max(50, LEAST_SHARE * len(cloud)):
        inliers = _largest_plane(left, thickness, rng)
        if len(inliers) < max(30, LEAST_SHARE * len(cloud)):
            break
        normal, offset = _least_squares_plane(left[inliers])
        heights = cloud @ normal - offset
        planes.append(
            TablePlane(
                normal,
                offset,
                int((np.abs(heights) < thickness).sum()),
                float((heights < -BEHIND).mean()),
            )
        )
        left = left[np.abs(left @ normal - offset) > 1.5 * thickness]
    return planes


def find_table(cloud: FloatArray, thickness: float) -> TablePlane:
    """Find the large plane with fewest points behind it in a cloud (n, 3) [m], camera frame.

    The block's top has the table behind it and a side has the top; the table has only stray points.
    RegistrationError without a large plane.
    """
    planes = find_planes(cloud, thickness)
    if not planes:
        raise RegistrationError(
            f"no plane holds {LEAST_SHARE:.0%} of the {len(cloud)} points of the rest cloud, a "
            "table was expected: "
            "record it with the table in view, or give [camera] to_phantom as a first guess"
        )
    return min(
        planes,
        key=lambda plane: (plane.behind > 0.1, plane.behind - 0.05 * plane.count / len(cloud)),
    )


def _largest_plane(points: FloatArray, thickness: float, rng: np.random.Generator) -> IntArray:
    """Rows (m,) of the points (n, 3) [m] within `thickness` [m] of the plane through three of them
    that has most.

    Open3D's `segment_plane` draws in several threads, so that two calls with one seed differ.
    """
    corners = points[rng.integers(len(points), size=(_DRAWS, 3))]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normals, axis=1)
    sound = length > 1e-12
    normals = normals[sound] / length[sound, None]
    offsets = np.einsum("ij,ij->i", normals, corners[sound, 0])
    counts = [
        (np.abs(points @ some.T - own) < thickness).sum(axis=0)
        for some, own in zip(
            np.array_split(normals, _BATCHES), np.array_split(offsets, _BATCHES), strict=True
        )
    ]
    if not len(normals):
        return np.empty(0, dtype=int)
    best = int(np.concatenate(counts).argmax())
    return np.flatnonzero(np.abs(points @ normals[best] - offsets[best]) < thickness)


def _least_squares_plane(points: FloatArray) -> tuple[FloatArray, float]:
    """Unit normal (3,) towards the origin, where the camera is, and offset [m]."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    if normal @ centre > 0:
        normal = -normal
    return normal, float(normal @ centre)
