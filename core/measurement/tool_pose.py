"""Pose of the tool in a cloud: its centre and the direction of its shaft."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.dataset import Dataset, Kinematics
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.faces import box_distance
from palpate.registration.registration import Registration

__all__ = ["SHAFT_LENGTH", "ToolPose", "find_shaft_axis", "locate_tool", "tool_poses"]

FARTHEST_SHIFT = 6.0e-3
"""Largest correction of the tool's position from the clouds [m]."""
SHAFT_LENGTH = 0.3
"""Length of the shaft along which points count as the shaft's [m]."""


@dataclass(frozen=True, eq=False)
class ToolPose:
    """The tool in one frame, phantom frame.

    Attributes:
        centre: (3,) [m].
        shaft: (3,) unit vector from the tip along the shaft; None if unknown.
    """

    centre: FloatArray
    shaft: FloatArray | None


def locate_tool(points: FloatArray, apart: FloatArray, tool: ToolPose, radius: float) -> ToolPose:
    """Move the tool across its shaft to where the camera sees the shaft; for segmentation only.

    Args:
        points: (n, 3) [m], phantom frame, without the table.
        apart: (n,) distance from the block [m].
        tool: pose by the kinematics; clocks and calibration may be off by some millimetres.
        radius: of the tool [m]; that of the shaft is fitted.
    """
    if tool.shaft is None:
        return tool
    offset = points - tool.centre
    height = offset @ tool.shaft
    across = offset - height[:, None] * tool.shaft
    certain = (apart > 6.0e-3) & (height > radius) & (height < SHAFT_LENGTH)
    certain &= np.linalg.norm(across, axis=1) < radius + FARTHEST_SHIFT
    if np.count_nonzero(certain) < 40:
        return tool
    first = np.linalg.svd(tool.shaft[None])[2][1]
    plane = across[certain] @ np.stack([first, np.cross(tool.shaft, first)]).T
    shift = _circle_centre(plane, 0.8 * radius)
    if np.linalg.norm(shift) > FARTHEST_SHIFT:
        return tool
    return replace(
        tool, centre=tool.centre + shift @ np.stack([first, np.cross(tool.shaft, first)])
    )


def _circle_centre(points: FloatArray, radius: float) -> FloatArray:
    """Fit the centre (2,) [m] of a circle of about `radius` [m] to points (n, 2) [m].

    Robust Gauss-Newton with a prior, which short arcs need.
    """
    state = np.array([0.0, 0.0, radius])
    prior = np.diag([1 / 0.003**2, 1 / 0.003**2, 1 / (0.1 * radius) ** 2])
    for _ in range(6):
        arm = points - state[:2]
        length = np.maximum(np.linalg.norm(arm, axis=1), 1e-6)
        residual = length - state[2]
        sigma = max(1.4826 * float(np.median(np.abs(residual))), 2e-4)
        weights = 1 / (1 + (residual / (2 * sigma)) ** 2) / sigma**2
        jacobian = np.column_stack([-arm / length[:, None], -np.ones(len(arm))])
        weighted = jacobian * weights[:, None]
        pull = prior @ (state - np.array([0.0, 0.0, radius]))
        state = state - np.linalg.solve(weighted.T @ jacobian + prior, weighted.T @ residual + pull)
    return np.asarray(state[:2])


def tool_poses(
    kinematics: Kinematics,
    times: FloatArray,
    phantom_from_robot: Transform,
    shaft_axis: FloatArray | None,
) -> list[ToolPose]:
    """The tool at `times` (m,) [s].

    Args:
        kinematics: of the sequence.
        times: (m,) [s].
        phantom_from_robot: registration.
        shaft_axis: (3,) direction of the shaft in the tool's own frame (see `find_shaft_axis`).
    """
    centres = phantom_from_robot.apply(kinematics.position_at(times))
    if shaft_axis is None:
        return [ToolPose(centre, None) for centre in centres]
    rows = np.clip(np.searchsorted(kinematics.time, times), 0, len(kinematics.time) - 1)
    shafts = phantom_from_robot.rotate(
        Rotation.from_quat(kinematics.quaternion[rows]).apply(shaft_axis)
    )
    return [ToolPose(centre, shaft) for centre, shaft in zip(centres, shafts, strict=True)]


def find_shaft_axis(
    dataset: Dataset, registration: Registration, frames: int = 3
) -> FloatArray | None:
    """Find the axis (3,) of the tool's frame that points from the tip along the shaft.

    Of the six axes it is the one along which the clouds show points. On a dVRK it is -z. None where
    no axis has at least half of the points clear of block and table.
    """
    axes = np.concatenate([-np.eye(3)[::-1], np.eye(3)])
    hits, total = np.zeros(6), 0
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        for index in (
            np.unique(np.linspace(0, len(sequence) - 1, frames + 2).astype(int)[1:-1])
            if len(sequence)
            else ()
        ):
            points = registration.phantom_from_camera.apply(sequence.cloud(int(index)))
            clear = points[
                (box_distance(points, np.asarray(dataset.config.size)) > 6.0e-3)
                & (points[:, 2] > 6.0e-3)
            ]
            times = sequence.cloud_times[index : index + 1]
            poses = [
                tool_poses(sequence.kinematics, times, registration.phantom_from_robot, axis)[0]
                for axis in axes
            ]
            hits += [_on_shaft(clear, pose, dataset.config.tool_radius + 0.004) for pose in poses]
            total += len(clear)
    best = int(hits.argmax())
    return axes[best] if total >= 50 and hits[best] > 0.5 * total else None


def _on_shaft(points: FloatArray, tool: ToolPose, radius: float) -> int:
    offset = points - tool.centre
    height = offset @ (tool.shaft if tool.shaft is not None else np.zeros(3))
    across = np.sqrt(np.maximum((offset**2).sum(axis=1) - height**2, 0.0))
    return int(((height > 0) & (across < radius)).sum())
