"""Rigid transforms between the three frames of an experiment.

phantom: origin at the centre of the phantom's base, z up, x along the long side; the simulation
runs in it.
robot: the manipulator's base frame.
camera: the depth camera's optical frame, x right, y down, z forward.

A transform is named `target_from_source`: `phantom_from_camera.apply(points_in_camera)` gives
points in the phantom frame, and `a_from_b @ b_from_c` is `a_from_c`. Lengths are metres;
quaternions are (x, y, z, w), the last one real.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError

__all__ = ["Transform"]

_ROTATION_TOLERANCE = 1e-4
"""Largest deviation of an entry of R R^T from the identity [1]; 10 % more on its diagonal."""


def _is_rotation(matrix: FloatArray) -> bool:
    """Whether a (3, 3) matrix is a proper rotation, to 1e-4.

    Eight times as fast as NumPy: a diagnosis makes thousands of transforms.
    """
    rows = matrix.tolist()
    (a, b, c), (d, e, f), (g, h, i) = rows
    for number, one in enumerate(rows):
        for other in range(number, 3):
            expected, product = (
                float(number == other),
                sum(x * y for x, y in zip(one, rows[other], strict=True)),
            )
            if not abs(product - expected) <= _ROTATION_TOLERANCE * (1 + 0.1 * expected):
                return False
    return bool(a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0)


@dataclass(frozen=True, eq=False)
class Transform:
    """A rigid motion x -> R x + t.

    Attributes:
        rotation: (3, 3) proper rotation matrix.
        translation: (3,) [m].
    """

    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    translation: FloatArray = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        rotation = np.array(self.rotation, dtype=float)
        translation = np.array(self.translation, dtype=float)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise SetupError(
                "a transform needs a 3x3 rotation and 3 numbers, "
                f"got {rotation.shape} and {translation.shape}"
            )
        if not _is_rotation(rotation):
            deviation = np.abs(rotation @ rotation.T - np.eye(3)).max()
            raise SetupError(f"not a rotation: R R^T differs from 1 by {deviation:.2g}")
        rotation.setflags(write=False)
        translation.setflags(write=False)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def from_matrix(cls, matrix: Any) -> Transform:
        """Make a transform from a row-major 4x4 homogeneous matrix.

        The rotation is orthonormalised, because numbers in files are rounded.
        """
        array = np.asarray(matrix, dtype=float)
        if array.shape != (4, 4):
            raise SetupError(f"a pose needs a 4x4 matrix, got shape {array.shape}")
        u, _, vt = np.linalg.svd(array[:3, :3])
        if not np.allclose(u @ vt, array[:3, :3], atol=1e-2):
            raise SetupError("the upper left 3x3 of the pose is not a rotation")
        return cls(u @ vt, array[:3, 3])

    @classmethod
    def from_vector(cls, translation: Any, rotation_vector: Any) -> Transform:
        """Make a transform from a translation [m] and a rotation vector [rad], each (3,)."""
        return cls(
            Rotation.from_rotvec(np.asarray(rotation_vector, dtype=float)).as_matrix(),
            np.asarray(translation, dtype=float),
        )

    @property
    def matrix(self) -> FloatArray:
        """The (4, 4) homogeneous matrix."""
        matrix = np.eye(4)
        matrix[:3, :3] = self.rotation
        matrix[:3, 3] = self.translation
        return matrix

    @property
    def rotation_vector(self) -> FloatArray:
        """The (3,) rotation vector [rad]."""
        return np.asarray(Rotation.from_matrix(self.rotation).as_rotvec())

    def apply(self, points: FloatArray) -> FloatArray:
        """Move points (..., 3) [m] from the source frame into the target frame."""
        return np.asarray(points) @ self.rotation.T + self.translation

    def rotate(self, vectors: FloatArray) -> FloatArray:
        """Rotate directions (..., 3), without the translation."""
        return np.asarray(vectors) @ self.rotation.T

    def inverse(self) -> Transform:
        """The inverse transform."""
        return Transform(self.rotation.T, -self.rotation.T @ self.translation)

    def __matmul__(self, other: Transform) -> Transform:
        return Transform(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )
