"""Coarse registration of a rest cloud: ICP of Open3D against the stated block and its table."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.faces import TABLE_REACH, camera_planes

__all__ = ["align_by_icp"]


def align_by_icp(
    cloud: FloatArray, size: tuple[float, float, float], guess: Transform
) -> Transform:
    """Align a rest cloud (n, 3) [m] by point-to-plane ICP from `guess` (phantom_from_camera).

    The target is sampled on the visible faces of a block of `size` [m] and on the table around it.
    A result that moves the middle of the top by 50 mm or more is rejected for the guess.
    """
    import open3d as o3d

    points, normals = _sample_surface(size, guess.translation)
    target = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    target.normals = o3d.utility.Vector3dVector(normals)
    source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(cloud)).voxel_down_sample(2.0e-3)
    registration = o3d.pipelines.registration
    pose = guess.matrix
    for reach in (0.015, 0.008, 0.004):
        to_plane = registration.TransformationEstimationPointToPlane(
            registration.TukeyLoss(k=reach)
        )
        criteria = registration.ICPConvergenceCriteria(max_iteration=40)
        pose = np.asarray(
            registration.registration_icp(
                source, target, reach, pose, to_plane, criteria
            ).transformation
        )
    aligned = Transform.from_matrix(pose)
    moved = np.linalg.norm(
        (aligned @ guess.inverse()).apply(np.array([0.0, 0.0, size[2]]))
        - np.array([0.0, 0.0, size[2]])
    )
    return aligned if moved < 0.05 else guess


def _sample_surface(
    size: tuple[float, float, float], camera: FloatArray, step: float = 1.5e-3
) -> tuple[FloatArray, FloatArray]:
    """Sample points (m, 3) [m] and normals (m, 3) on the faces that a camera at (3,) [m] sees, and
    on the table beside them.
    """
    planes = camera_planes(size, camera)
    reach = np.array(size) / 2 + np.array([TABLE_REACH, TABLE_REACH, 0.0])
    axes = [np.arange(-r, r, step) for r in reach]
    x, y = (grid.ravel() for grid in np.meshgrid(axes[0], axes[1]))
    half_x, half_y, height = size[0] / 2, size[1] / 2, size[2]
    over = (np.abs(x) < half_x) & (np.abs(y) < half_y)
    points = [np.column_stack([x, y, np.where(over, height, 0.0)])]
    normals = [np.tile([0.0, 0.0, 1.0], (len(x), 1))]
    for k, (axis, sign) in enumerate(((0, -1), (0, 1), (1, -1), (1, 1)), start=1):
        if planes.visible[k]:
            along, z = (
                grid.ravel()
                for grid in np.meshgrid(
                    np.arange(-size[1 - axis] / 2, size[1 - axis] / 2, step),
                    np.arange(0, height, step),
                )
            )
            side, normal = np.zeros((len(along), 3)), np.zeros((len(along), 3))
            side[:, axis], side[:, 1 - axis], side[:, 2], normal[:, axis] = (
                sign * size[axis] / 2,
                along,
                z,
                sign,
            )
            points.append(side)
            normals.append(normal)
    return np.concatenate(points), np.concatenate(normals)
