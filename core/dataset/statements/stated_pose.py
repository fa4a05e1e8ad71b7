"""Poses that a calibration gave, with their stated accuracies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.dataset.statements.checked_keys import Keys
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["StatedPose", "read_stated_pose"]

_USUAL = {"phantom_from_robot": (1e-3, 0.01), "robot_from_camera": (3e-3, 0.02)}
"""Accuracy of a pose where none is stated: of its position [m] and of its rotation [rad]."""


@dataclass(frozen=True, eq=False)
class StatedPose:
    """A rigid transform with its accuracy.

    Attributes:
        pose: the transform.
        position_sigma: standard deviation of each coordinate of its translation [m].
        rotation_sigma: standard deviation of the rotation about each axis [rad].
    """

    pose: Transform
    position_sigma: float
    rotation_sigma: float

    @property
    def covariance(self) -> FloatArray:
        """Covariance (6, 6) [m, rad] of a small motion about the origin of the target frame."""
        return np.diag([self.position_sigma**2] * 3 + [self.rotation_sigma**2] * 3)

    def after(self, target_from_target: Transform) -> StatedPose:
        """The same pose in another target frame."""
        return replace(self, pose=target_from_target @ self.pose)


def read_stated_pose(keys: Keys, key: str) -> StatedPose | None:
    """Read a pose and the accuracies beside it; None where the table does not have this key."""
    sigmas = ("position_sigma", "rotation_sigma")
    if key not in keys.values:
        for name in sigmas:
            if name in keys.values:
                raise keys.wrong(name, keys.values[name], f"this key beside {key} only: add {key}")
        return None
    position, rotation = _USUAL[key]
    return StatedPose(
        keys.pose(key),
        keys.number("position_sigma", 1e-6, 0.5, "m", default=position),
        keys.number("rotation_sigma", 1e-6, np.pi, "", default=rotation),
    )
