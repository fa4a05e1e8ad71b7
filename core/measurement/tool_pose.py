"""The tool in a cloud: its centre, and the shaft that the camera sees beside it.

Whether a point lies on the shaft is judged along its line of sight: a depth camera has noise along
it and hardly any across it. A distance to the shaft's axis would take the phantom's points for the
shaft's where noise lifts them, and keep those that noise sinks.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.dataset import Dataset, Kinematics
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.registration import Registration

__all__ = ["SHAFT_LENGTH", "ToolPose", "ToolShaft", "find_shaft", "locate_tool", "tool_poses"]

FARTHEST_SHIFT = 6.0e-3
"""Largest correction of the tool's position from the clouds [m]."""
SHAFT_LENGTH = 0.3
"""Length of the shaft along which points count as the shaft's [m]."""
_CLEAR = 6.0e-3
"""Distance from the block beyond which no point is the phantom's [m]."""
_FEWEST = 40
"""Least points on the shaft that place it."""
_TAIL = 0.1
"""Share of the points at either edge of the shaft's picture that may be strays [1]."""


@dataclass(frozen=True, eq=False)
class ToolShaft:
    """The rod behind the ball.

    Attributes:
        axis: (3,) unit vector from the ball along the rod.
        radius: [m].
    """

    axis: FloatArray
    radius: float


@dataclass(frozen=True, eq=False)
class ToolPose:
    """The tool in one frame, phantom frame.

    Attributes:
        centre: (3,) of the ball [m].
        shaft: None if unknown.
    """

    centre: FloatArray
    shaft: ToolShaft | None


@dataclass(frozen=True, eq=False)
class ShaftSight:
    """Lines of sight from a camera towards a shaft, without end at either side.

    Attributes:
        across: (n,) signed distance of each line from the axis [m].
        front: (n,) distance from the camera to the shaft's front along the line [m]; to the place
            nearest to the axis for a line that passes beside it.
        height: (n,) of that place over the ball's centre, along the axis [m].
        slant: (n,) sine of the angle between line and axis [1].
        sideways: (3,) unit vector along which `across` counts, the mean of the lines'.
        away: (3,) unit vector from the camera, at right angles to axis and `sideways`.
    """

    across: FloatArray
    front: FloatArray
    height: FloatArray
    slant: FloatArray
    sideways: FloatArray
    away: FloatArray

    @classmethod
    def of(
        cls, camera: FloatArray, lines: FloatArray, tool: ToolPose, shaft: ToolShaft
    ) -> ShaftSight:
        """Lines (n, 3) of sight, unit vectors from the camera (3,) [m], phantom frame."""
        start = camera - tool.centre
        level = lines - (lines @ shaft.axis)[:, None] * shaft.axis
        begin = start - (start @ shaft.axis) * shaft.axis
        slant = np.maximum(np.linalg.norm(level, axis=1), 1e-6)
        level = level / slant[:, None]
        sideways = np.cross(shaft.axis, level)
        across = sideways @ begin
        nearest = -(level @ begin)
        half = np.sqrt(np.maximum(shaft.radius**2 - across**2, 0.0))
        front = (nearest - half) / slant
        height = start @ shaft.axis + front * (lines @ shaft.axis)
        away = level.mean(axis=0) if len(level) else -begin
        away = away / max(float(np.linalg.norm(away)), 1e-9)
        return cls(across, front, height, slant, np.cross(shaft.axis, away), away)


def locate_tool(
    points: FloatArray, apart: FloatArray, tool: ToolPose, camera: FloatArray, slack: float
) -> ToolPose:
    """Move the tool across its shaft to where the camera sees the shaft; for segmentation only.

    Args:
        points: (n, 3) [m], phantom frame, without the table.
        apart: (n,) distance from the block [m].
        tool: pose by the kinematics; clocks and calibration may be off by some millimetres.
        camera: (3,) place of the camera [m], phantom frame.
        slack: error that a depth may have [m].
    """
    if tool.shaft is None:
        return tool
    clear = points[apart > _CLEAR]
    seen, depth = _on_shaft(clear, tool, tool.shaft, camera, slack)
    if len(depth) < _FEWEST:
        return tool
    sideways = _middle(seen.across)
    moved = replace(tool, centre=tool.centre + sideways * seen.sideways)
    seen, depth = _on_shaft(clear, moved, tool.shaft, camera, slack)
    if len(depth) < _FEWEST:
        return tool
    away = float(np.median((depth - seen.front) * seen.slant))
    if np.hypot(sideways, away) > FARTHEST_SHIFT:
        return tool
    return replace(tool, centre=moved.centre + away * seen.away)


def _on_shaft(
    points: FloatArray, tool: ToolPose, shaft: ToolShaft, camera: FloatArray, slack: float
) -> tuple[ShaftSight, FloatArray]:
    """Lines of sight and depths (m,) [m] of the points (n, 3) [m] that can only be the shaft's."""
    lines = points - camera
    depth = np.linalg.norm(lines, axis=1)
    lines = lines / np.maximum(depth, 1e-9)[:, None]
    seen = ShaftSight.of(camera, lines, tool, shaft)
    certain = (seen.height > shaft.radius) & (seen.height < SHAFT_LENGTH)
    certain &= np.abs(seen.across) < shaft.radius + FARTHEST_SHIFT
    certain &= np.abs(depth - seen.front) < FARTHEST_SHIFT + slack
    return ShaftSight.of(camera, lines[certain], tool, shaft), depth[certain]


def _middle(across: FloatArray) -> float:
    """Middle [m] of what distances (n,) [m] from the axis span, strays left out."""
    low, high = np.quantile(across, [_TAIL, 1 - _TAIL])
    return float(low + high) / 2


def tool_poses(
    kinematics: Kinematics,
    times: FloatArray,
    phantom_from_robot: Transform,
    shaft: ToolShaft | None,
) -> list[ToolPose]:
    """The tool at `times` (m,) [s].

    Args:
        kinematics: of the sequence.
        times: (m,) [s].
        phantom_from_robot: registration.
        shaft: in the tool's own frame (see `find_shaft`).
    """
    centres = phantom_from_robot.apply(kinematics.position_at(times))
    if shaft is None:
        return [ToolPose(centre, None) for centre in centres]
    rows = np.clip(np.searchsorted(kinematics.time, times), 0, len(kinematics.time) - 1)
    axes = phantom_from_robot.rotate(
        Rotation.from_quat(kinematics.quaternion[rows]).apply(shaft.axis)
    )
    return [
        ToolPose(centre, ToolShaft(axis, shaft.radius))
        for centre, axis in zip(centres, axes, strict=True)
    ]


def find_shaft(dataset: Dataset, registration: Registration, frames: int = 3) -> ToolShaft | None:
    """Find the direction of the shaft in the tool's own frame, and its radius.

    Of the frame's six axes the direction is the one along which the clouds show points; on a dVRK
    it is -z. None where no axis has at least half of the points clear of block and table. The
    radius is half of what the shaft spans across the lines of sight, which depth noise does not
    change; the tool's, where too few points show it.
    """
    axes = np.concatenate([-np.eye(3)[::-1], np.eye(3)])
    radius, reach = dataset.config.tool_radius, dataset.config.tool_radius + 0.004
    hits, total = np.zeros(6), 0
    spans: list[list[FloatArray]] = [[] for _ in axes]
    for name in dataset.sequences:
        sequence = dataset.sequence(name)
        for index in _some(len(sequence), frames):
            points = registration.phantom_from_camera.apply(sequence.cloud(int(index)))
            apart = dataset.geometry.outside(points)
            clear = points[(apart > _CLEAR) & (points[:, 2] > _CLEAR)]
            times, camera = (
                sequence.cloud_times[index : index + 1],
                registration.phantom_from_camera.translation,
            )
            for number, axis in enumerate(axes):
                (pose,) = tool_poses(
                    sequence.kinematics,
                    times,
                    registration.phantom_from_robot,
                    ToolShaft(axis, radius),
                )
                hits[number] += _count_near(clear, pose, reach)
                spans[number].append(_span(clear, pose, camera))
            total += len(clear)
    best = int(hits.argmax())
    if total < 50 or hits[best] <= 0.5 * total:
        return None
    across = np.concatenate(spans[best])
    if len(across) < _FEWEST:
        return ToolShaft(axes[best], radius)
    low, high = np.quantile(across, [_TAIL, 1 - _TAIL])
    return ToolShaft(axes[best], float(high - low) / 2 / (1 - 2 * _TAIL))


def _some(count: int, frames: int) -> FloatArray:
    """Indices of `frames` clouds, spread over the inside of a sequence of `count`."""
    if not count:
        return np.empty(0, dtype=int)
    return np.unique(np.linspace(0, count - 1, frames + 2).astype(int)[1:-1])


def _count_near(points: FloatArray, tool: ToolPose, reach: float) -> int:
    """How many points (n, 3) [m] lie within `reach` [m] of the shaft's axis."""
    offset = points - tool.centre
    height = offset @ (tool.shaft.axis if tool.shaft is not None else np.zeros(3))
    across = np.sqrt(np.maximum((offset**2).sum(axis=1) - height**2, 0.0))
    return int(((height > 0) & (across < reach)).sum())


def _span(points: FloatArray, tool: ToolPose, camera: FloatArray) -> FloatArray:
    """Distances (m,) [m] of the shaft's points from the middle of the shaft's picture; empty where
    too few show it.
    """
    if tool.shaft is None:
        return np.empty(0)
    # A shaft far thicker or thinner than the ball, and the ball's own neighbourhood, stay outside.
    seen, _ = _on_shaft(points, tool, tool.shaft, camera, 2 * FARTHEST_SHIFT)
    if len(seen.across) < _FEWEST:
        return np.empty(0)
    return np.asarray(seen.across - _middle(seen.across))
