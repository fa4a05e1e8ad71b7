"""What a tool path does to the box as stated: poke from above, push from the side, drag; how deep, where, how fast.

The stated box is rigid here, so that a depth is how far the sphere would overlap it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from core.dataset.folder import Dataset, Sequence
from core.frames import FloatArray, Transform

__all__ = ["MARGIN", "Motion", "MotionKind", "box_gap", "motion_of", "smooth_path"]

MotionKind = Literal["top", "side", "drag", "none"]

MARGIN = 0.0005  # m; about what touches are good for, so nearer counts as touching
_STEP = 0.05  # s; positions are averaged over it, or their noise would be taken for speed


@dataclass(frozen=True, kw_only=True)
class Motion:
    """One sequence in the phantom frame.

    Attributes:
        kind: "top" and "side" are pushes into that face, "drag" travels along it, "none" never touches.
        depth: deepest overlap of the sphere with the box at rest [m]; negative is the nearest it comes.
        place: tool centre at first contact, or where it comes nearest [m].
        travel: how far it moves along the touched face while in contact [m].
        speed: that three quarters of the contact stay below [m/s].
        untouched_before, untouched_after: clouds before the first and after the last contact.
        rest_after: time from the last contact to the last cloud, or row where there are no clouds [s].
    """

    kind: MotionKind
    depth: float
    place: tuple[float, float, float]
    travel: float
    speed: float
    untouched_before: int
    untouched_after: int
    rest_after: float


def box_gap(points: FloatArray, size: tuple[float, float, float], radius: float) -> FloatArray:
    """Gap (n,) [m] between a sphere centred at points (n, 3), phantom frame, and the box at rest; negative inside."""
    beyond = _beyond(points, size)
    return np.asarray(np.linalg.norm(np.maximum(beyond, 0), axis=-1) + np.minimum(beyond.max(axis=-1), 0) - radius)


def motion_of(dataset: Dataset, sequence: Sequence, phantom_from_robot: Transform) -> Motion:
    """What this sequence does, by the stated size, radius and registration."""
    size, radius = dataset.config.size, dataset.config.tool_radius
    time, path = smooth_path(sequence, phantom_from_robot)
    gap = box_gap(path, size, radius)
    touching = np.flatnonzero(gap < MARGIN)
    if len(touching) == 0:
        at = int(gap.argmin())
        return Motion(
            kind="none", depth=-float(gap[at]), place=_place(path[at]), travel=0.0, speed=0.0,
            untouched_before=len(sequence), untouched_after=0, rest_after=0.0,
        )  # fmt: skip
    first, last = int(touching[0]), int(touching[-1])
    axis = int(_beyond(path[first], size).argmax())
    along = np.delete(path[touching], axis, axis=1)
    travel, depth = float(np.linalg.norm(np.ptp(along, axis=0))), -float(gap.min())
    end = sequence.cloud_times[-1] if len(sequence) else time[-1]
    return Motion(
        kind=_kind(axis, travel, depth),
        depth=depth,
        place=_place(path[first]),
        travel=travel,
        speed=_speed(time[first : last + 1], path[first : last + 1]),
        untouched_before=int((sequence.cloud_times < time[first]).sum()),
        untouched_after=int((sequence.cloud_times > time[last]).sum()),
        rest_after=max(0.0, float(end - time[last])),
    )


def _beyond(points: FloatArray, size: tuple[float, float, float]) -> FloatArray:
    half = np.array(size) / 2
    # The base is no face to be touched: below the top, only the sides count.
    beyond = np.abs(points - np.array([0, 0, half[2]])) - half
    beyond[..., 2] = points[..., 2] - size[2]
    return np.asarray(beyond)


def _kind(axis: int, travel: float, depth: float) -> MotionKind:
    # A push wanders sideways by about its own depth; a drag goes on for several times that.
    if travel > max(2 * depth, 0.005):
        return "drag"
    return "top" if axis == 2 else "side"


def smooth_path(sequence: Sequence, phantom_from_robot: Transform) -> tuple[FloatArray, FloatArray]:
    """Time (n,) [s] and tool centre (n, 3) [m], phantom frame, averaged over short steps."""
    time, points = sequence.kinematics.time, phantom_from_robot.apply(sequence.kinematics.position)
    _, index, counts = np.unique(np.floor((time - time[0]) / _STEP), return_inverse=True, return_counts=True)
    columns = [time, *points.T]
    means = [np.bincount(index, weights=column) / counts for column in columns]
    return means[0], np.stack(means[1:], axis=-1)


def _speed(time: FloatArray, path: FloatArray) -> float:
    if len(time) < 2:
        return 0.0
    return float(np.percentile(np.linalg.norm(np.diff(path, axis=0), axis=1) / np.diff(time), 75))


def _place(point: FloatArray) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in point)
    return x, y, z
