"""The table in a raw cloud: the one large plane that has nearly nothing behind it, seen from the
camera.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError

__all__ = ["Table", "find_planes", "find_table"]

BEHIND = 5.0e-3
LEAST_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class Table:
    """A plane n.x = d in the camera frame: unit normal (3,) towards the camera, offset d [m],
    points in it, share behind it [1].
    """

    normal: FloatArray
    offset: float
    count: int
    behind: float

    def height(self, points: FloatArray) -> FloatArray:
        """Height (n,) [m] of points (n, 3), camera frame, over the plane."""
        return np.asarray(points @ self.normal - self.offset)


def find_planes(cloud: FloatArray, thickness: float, most: int = 4) -> list[Table]:
    """The largest planes of a cloud (n, 3) [m], camera frame, by RANSAC one after another; points
    within `thickness` [m] belong.
    """
    import open3d as o3d

    planes: list[Table] = []
    left = cloud
    # Open3D draws from its own generator: seeded, so that the same cloud gives the same
    # registration.
    o3d.utility.random.seed(0)
    while len(planes) < most and len(left) >= max(50, LEAST_SHARE * len(cloud)):
        points = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(left))
        _, inliers = points.segment_plane(
            distance_threshold=thickness, ransac_n=3, num_iterations=400
        )
        if len(inliers) < max(30, LEAST_SHARE * len(cloud)):
            break
        normal, offset = _least_squares_plane(left[inliers])
        heights = cloud @ normal - offset
        planes.append(
            Table(
                normal,
                offset,
                int((np.abs(heights) < thickness).sum()),
                float((heights < -BEHIND).mean()),
            )
        )
        left = left[np.abs(left @ normal - offset) > 1.5 * thickness]
    return planes


def find_table(cloud: FloatArray, thickness: float) -> Table:
    """The plane with least behind it among the large planes of a cloud (n, 3) [m], camera frame.

    The block's top has the table behind it and a side has the top; the table has only stray points.
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


def _least_squares_plane(points: FloatArray) -> tuple[FloatArray, float]:
    """Unit normal (3,) towards the origin, where the camera is, and offset [m]."""
    centre = points.mean(axis=0)
    normal = np.linalg.svd(points - centre, full_matrices=False)[2][2]
    if normal @ centre > 0:
        normal = -normal
    return normal, float(normal @ centre)
