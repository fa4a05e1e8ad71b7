"""Camera model: readings to points in the phantom frame, with pose and depth errors of a setup.

The stated pose comes from the registration of the rest cloud to the stated body on its table. If
the camera misreads depth, or the body has another size, the same registration gives the stated
pose from another true pose. The error is computed here without the cloud. A free form's is that of
`palpate.registration.shape.shape_response`. For a block, the visible planes of the true block, read
with the camera's error, are registered to the stated planes, and the motion found is inverted.
Table and sides determine the pose, and the top may be offset as a whole, as in
`palpate.registration.camera.block_fit`, where the table has most points. Along an axis without a
visible side the pose stays as stated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.frames import Transform
from palpate.registration.faces import NORMALS, camera_planes
from palpate.registration.pose import motion_jacobian, small_motion
from palpate.registration.shape.shape_response import registration_error
from palpate.setup.setup import Setup

__all__ = ["CameraModel", "camera_model_for"]

_TOP, _TABLE = 0, 5
_POINTS = 6
"""Number of points along each edge of each side."""
_TABLE_WIDTH = 0.05
"""Width of the visible table around the block [m]."""
_ROUNDS, _HELD = 12, 1e-6
"""Number of Gauss-Newton steps, and weight of the stated pose in directions without a plane."""


@dataclass(frozen=True, eq=False)
class CameraModel:
    """Relation between readings, camera frame, and points, phantom frame.

    Attributes:
        pose: phantom_from_camera.
        offset: a depth z is read as scale z + offset [m].
        scale: see `offset` [1].
    """

    pose: Transform
    offset: float = 0.0
    scale: float = 1.0

    def place(self, readings: FloatArray) -> FloatArray:
        """Points (m, 3) [m], phantom frame, of readings (m, 3) [m]; depth errors are along the
        ray.
        """
        if self.exact:
            return self.pose.apply(readings)
        return self.pose.apply(readings * ((1.0 - self.offset / readings[:, 2:]) / self.scale))

    def read(self, places: FloatArray) -> FloatArray:
        """Readings (m, 3) [m] of points (m, 3) [m], the inverse of `place`."""
        true = self.pose.inverse().apply(places)
        return true if self.exact else true * (self.scale + self.offset / true[:, 2:])

    @property
    def exact(self) -> bool:
        """Whether depth is read without error."""
        return self.offset == 0.0 and self.scale == 1.0

    def same(self, other: CameraModel) -> bool:
        """Whether both models are identical."""
        depth = (self.offset, self.scale) == (other.offset, other.scale)
        return depth and np.array_equal(self.pose.matrix, other.pose.matrix)


def camera_model_for(setup: Setup, *, reference: bool = False) -> CameraModel:
    """The camera model of a setup; with `reference` that of the rest cloud, before any shift."""
    sensor = setup.sensor
    pose = _registration_error(setup) @ setup.phantom_from_camera
    return CameraModel(
        pose if reference else sensor.camera_shift @ pose, sensor.depth_offset, sensor.depth_scale
    )


def _registration_error(setup: Setup) -> Transform:
    """Motion from the stated to the true phantom_from_camera of the rest cloud."""
    sensor = setup.sensor
    if setup.registered is None and sensor.depth_offset == 0.0 and sensor.depth_scale == 1.0:
        return Transform()
    if not setup.stated_geometry.is_block:
        return registration_error(
            setup.stated_geometry, setup.phantom_from_camera, sensor, setup.scale
        )
    stated, true_size = setup.stated_geometry.size, np.array(setup.geometry.size)
    places, face, column = _seen(
        stated, tuple(float(part) for part in setup.phantom_from_camera.translation)
    )
    true_places = np.where(face[:, None] == _TABLE, places, places * true_size / np.array(stated))
    normals, distances = NORMALS[face], np.einsum("mi,mi->m", NORMALS[face], places)
    pivot, laid = np.array([0.0, 0.0, stated[2]]), Transform()
    for _ in range(_ROUNDS):
        true = CameraModel(
            laid.inverse() @ setup.phantom_from_camera, sensor.depth_offset, sensor.depth_scale
        )
        found = setup.phantom_from_camera.apply(true.read(true_places))
        jacobian = np.column_stack(
            [np.einsum("mi,mij->mj", normals, motion_jacobian(found, pivot)), column]
        )
        normal = jacobian.T @ jacobian + np.diag([_HELD] * 3 + [_HELD * stated[0] ** 2] * 3 + [0.0])
        step = -np.linalg.solve(
            normal, jacobian.T @ (np.einsum("mi,mi->m", found, normals) - distances)
        )
        laid = small_motion(step[:6], pivot) @ laid
        if np.abs(step[:6]).max() < 1e-14:
            break
    return laid.inverse()


@lru_cache(maxsize=16)
def _seen(
    size: tuple[float, float, float], camera: tuple[float, float, float]
) -> tuple[FloatArray, IntArray, FloatArray]:
    """Sample the planes that a camera at (3,) [m] sees.

    Returns:
        points (m, 3) [m], their number in `FACES` (m,), and 1 on the top (m,).
    """
    planes = camera_planes(size, np.array(camera))
    x, y, z = size
    shares = (np.arange(_POINTS) + 0.5) / _POINTS
    u, v = (grid.ravel() for grid in np.meshgrid(shares, shares))
    places, faces = (
        [np.column_stack([(u - 0.5) * x, (v - 0.5) * y, np.full(len(u), z)])],
        [np.full(len(u), _TOP)],
    )
    for number, (axis, sign) in enumerate(((0, -1), (0, 1), (1, -1), (1, 1)), start=1):
        if planes.visible[number]:
            side = np.empty((len(u), 3))
            side[:, axis], side[:, 1 - axis], side[:, 2] = (
                sign * size[axis] / 2,
                (u - 0.5) * size[1 - axis],
                v * z,
            )
            places.append(side)
            faces.append(np.full(len(u), number))
    around = np.column_stack(
        [(u - 0.5) * (x + 2 * _TABLE_WIDTH), (v - 0.5) * (y + 2 * _TABLE_WIDTH), np.zeros(len(u))]
    )
    around = around[(np.abs(around[:, :2]) > np.array(size[:2]) / 2).any(axis=1)]
    face = np.concatenate([*faces, np.full(len(around), _TABLE)])
    return np.concatenate([*places, around]), face, (face == _TOP).astype(float)
