"""The seen shaft against the tool's frame: the order of the quaternions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.consistency.seen_tool import SeenTool
from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.registration.registration import Registration

__all__ = ["tool_frame_doubts"]

SWEEP = np.radians(15.0)
"""Angle between the seen shaft and one direction of the tool's frame from which it is told
[rad]."""
STEADY = np.radians(8.0)
"""Angle up to which another order of the quaternion explains the shaft [rad]."""
_FEWEST = 6
"""Least frames with a seen shaft."""


def tool_frame_doubts(
    dataset: Dataset, registration: Registration, seen: Sequence[SeenTool]
) -> tuple[str, ...]:
    """A sentence where the shaft in the clouds has no fixed direction in the tool's frame."""
    axes, quaternions = _shown(dataset, registration, seen)
    if len(axes) < _FEWEST:
        return ()
    stated = _off(axes, quaternions)
    if stated < SWEEP:
        return ()
    others = {
        "with qw in the first of the four columns": quaternions[:, [1, 2, 3, 0]],
        "inverted, as robot to tool": quaternions * np.array([-1.0, -1.0, -1.0, 1.0]),
        "in the order qw, qz, qy, qx": quaternions[:, ::-1],
        "inverted, and with qw first": quaternions[:, [1, 2, 3, 0]]
        * np.array([-1.0, -1.0, -1.0, 1.0]),
    }
    words, best = min(
        ((name, _off(axes, other)) for name, other in others.items()), key=lambda pair: pair[1]
    )
    told = (
        f"kinematics.csv: the shaft that the clouds show is {np.degrees(stated):.0f} degrees off "
        f"every axis of the tool's frame (within {np.degrees(SWEEP):.0f} degrees of one is "
        "expected)"
    )
    if best < min(STEADY, 0.6 * stated):
        return (
            f"{told}, and {np.degrees(best):.0f} degrees if the quaternions are read {words}: "
            "export qx, qy, qz, qw of the tool in the robot frame",
        )
    return (
        f"{told}: the shaft cannot be told from the phantom in the clouds; export the orientation "
        "of the tool as qx, qy, qz, qw, with the shaft along an axis of its frame",
    )


def _shown(
    dataset: Dataset, registration: Registration, seen: Sequence[SeenTool]
) -> tuple[FloatArray, FloatArray]:
    """Seen axes (m, 3), robot frame, and the quaternions (m, 4) of their frames as in the file."""
    back = registration.repaired.phantom_from_robot.inverse()
    axes, quaternions = [np.zeros((0, 3))], [np.zeros((0, 4))]
    for one in seen:
        clock = dataset.sequence(one.name).kinematics
        if len(one.time):
            rows = np.clip(np.searchsorted(clock.time, one.time), 0, len(clock.time) - 1)
            axes.append(back.rotate(one.axis))
            quaternions.append(clock.quaternion[rows])
    return np.concatenate(axes), np.concatenate(quaternions)


def _off(axes: FloatArray, quaternions: FloatArray) -> float:
    """Median angle [rad] between axes (m, 3), robot frame, and the nearest common axis of the
    tool's frame.
    """
    own = Rotation.from_quat(quaternions).inv().apply(axes)
    angles = np.arccos(np.clip(np.concatenate([own, -own], axis=1), -1.0, 1.0))
    return float(np.median(angles, axis=0).min())
