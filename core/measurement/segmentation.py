"""Phantom points out of raw clouds: table, tool, shaft, background and stray points are taken out
and counted.

What does not change between frames is found once: the table by RANSAC in the rest cloud, the
direction of the shaft in the tool's frame. Each frame then costs a few vectorised tests. All of
them allow for noise along the line of sight, since a depth camera has hardly any across it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.ndimage import uniform_filter
from scipy.spatial.transform import Rotation

from palpate.dataset import Dataset, Kinematics
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.faces import box_distance
from palpate.registration.registration import Registration
from palpate.registration.table_plane import find_table

__all__ = [
    "REASONS",
    "CleanCloud",
    "Cleaner",
    "ToolPose",
    "cleaner_for",
    "find_shaft_axis",
    "locate_tool",
    "tool_poses",
]

IndexArray = np.ndarray[Any, np.dtype[np.int64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]

REASONS = ("kept", "table", "tool", "shaft", "background", "stray")
SIGMAS = 3.0
POSE_ERROR = 5.0e-4
"""What the tool's stated place may be off [m] after `locate_tool`; widens the tests on tool and
shaft."""
FARTHEST_SHIFT = 6.0e-3
TABLE_REACH = 0.08
FARTHEST_TABLE, FEWEST_ON_TABLE = 8.0e-3, 100
SHAFT_LENGTH = 0.3
VOXEL = 2.0e-3
LONELY = 0.2


@dataclass(frozen=True, eq=False)
class ToolPose:
    """The tool in one frame: centre (3,) [m], and unit direction (3,) from the tip along the shaft
    if known; phantom frame.
    """

    centre: FloatArray
    shaft: FloatArray | None


@dataclass(frozen=True, eq=False)
class CleanCloud:
    """The phantom's points of one raw cloud.

    Attributes:
        points: (n, 3) [m], phantom frame.
        indices: (n,) rows of the raw cloud.
        table_points: (m, 3) [m] of the table around the phantom, phantom frame.
        counts: how many points were kept, and how many were removed for each of REASONS.
    """

    points: FloatArray
    indices: IndexArray
    table_points: FloatArray
    counts: dict[str, int]


@dataclass(frozen=True, kw_only=True, eq=False)
class Cleaner:
    """What the clouds of a dataset have in common; `clean` takes the phantom out of one of them.

    Attributes:
        size: of the block [m].
        phantom_from_camera: its registration.
        tool_radius: of the sphere, and at most of the shaft [m].
        noise: standard deviation of depth along the line of sight [m].
        table: normal (3,) and offset [m] of the table, phantom frame; the plane z = 0 unless the
            rest cloud says otherwise. Each frame that shows enough of the table corrects it.
        bulge: how far [m] the deformed or slid phantom may reach beyond the box.
    """

    size: tuple[float, float, float]
    phantom_from_camera: Transform
    tool_radius: float
    noise: float
    table: tuple[FloatArray, float] = (np.array([0.0, 0.0, 1.0]), 0.0)
    bulge: float = 0.01

    def clean(self, cloud: FloatArray, tool: ToolPose | None = None) -> CleanCloud:
        """Take the phantom's points out of a raw cloud (n, 3) [m], camera frame; without a tool
        nothing is removed for it.
        """
        points = self.phantom_from_camera.apply(cloud)
        reason = np.zeros(len(points), dtype=np.int8)
        apart = box_distance(points, np.asarray(self.size))
        height = self._height(points, apart)
        thickness = self._thickness
        reason[apart > self.bulge] = REASONS.index("background")
        on_table = np.abs(height) < thickness
        reason[height < thickness] = REASONS.index("background")
        reason[on_table] = REASONS.index("table")
        if tool is not None:
            near = np.flatnonzero(reason != REASONS.index("table"))
            is_tool, is_shaft = self._tool_points(
                points[near], locate_tool(points[near], apart[near], tool, self.tool_radius)
            )
            reason[near[is_tool]] = REASONS.index("tool")
            reason[near[is_shaft & ~is_tool]] = REASONS.index("shaft")
        kept = np.flatnonzero(reason == 0)
        reason[kept[_lonely(points[kept])]] = REASONS.index("stray")
        indices = np.flatnonzero(reason == 0)
        counts = np.bincount(reason, minlength=len(REASONS))
        return CleanCloud(
            points[indices],
            indices,
            points[on_table & (apart > thickness) & (apart < TABLE_REACH)],
            {name: int(count) for name, count in zip(REASONS, counts, strict=True)},
        )

    @property
    def lowest(self) -> float:
        """Height [m] over the table up to which noise decides whether a point passes for the
        table's.

        What is kept of a side below it are the points that noise has lifted: they stand out by a
        part of it, and the more, the lower they are.
        """
        return 2 * self._thickness

    @property
    def _thickness(self) -> float:
        """How far from the table's plane a point is the table's [m]."""
        return max(SIGMAS * self.noise * self._table_slant(), 1.0e-3)

    def _height(self, points: FloatArray, apart: FloatArray) -> FloatArray:
        """Height (n,) [m] over the table as this frame shows it: a camera that was bumped sees it
        tilted and shifted.
        """
        height = points @ self.table[0] - self.table[1]
        around = np.flatnonzero(
            (np.abs(height) < FARTHEST_TABLE) & (apart > FARTHEST_TABLE) & (apart < TABLE_REACH)
        )
        if len(around) < FEWEST_ON_TABLE:
            return np.asarray(height)
        around = around[:: len(around) // 2000 + 1]
        basis = np.column_stack([points[around, :2], np.ones(len(around))])
        plane: FloatArray = np.zeros(3)
        for _ in range(8):
            residual = height[around] - basis @ plane
            sigma = max(1.4826 * float(np.median(np.abs(residual))), 1e-5)
            weighted = basis / (1 + (residual / (2 * sigma)) ** 2)[:, None]
            plane = np.asarray(
                np.linalg.solve(
                    weighted.T @ basis + 1e-12 * np.eye(3), weighted.T @ height[around]
                ),
                dtype=float,
            )
        return np.asarray(height - points[:, :2] @ plane[:2] - plane[2])

    def _table_slant(self) -> float:
        """Cosine between the table's normal and the line of sight to the block: how much of the
        depth noise is height.
        """
        sight = self.phantom_from_camera.translation
        return float(abs(self.table[0] @ sight) / max(float(np.linalg.norm(sight)), 1e-9))

    def _tool_points(self, points: FloatArray, tool: ToolPose) -> tuple[Mask, Mask]:
        """Which points (n, 3), phantom frame, lie on the sphere, and which on the shaft, as the
        camera sees them.

        A line of sight that passes through the sphere ends on its front. What lies farther back
        along it, beyond noise, was seen past a tool that is not quite where it was thought to be:
        that is surface, and is kept.
        """
        camera = self.phantom_from_camera.translation
        sight = points - camera
        depth = np.linalg.norm(sight, axis=1)
        sight /= np.maximum(depth, 1e-9)[:, None]
        to_centre = tool.centre - camera
        along = sight @ to_centre
        across = np.sqrt(np.maximum(to_centre @ to_centre - along**2, 0.0))
        front = along - np.sqrt(np.maximum(self.tool_radius**2 - across**2, 0.0))
        slack = SIGMAS * self.noise + POSE_ERROR
        is_tool = (across < self.tool_radius + POSE_ERROR) & (np.abs(depth - front) < slack)
        if tool.shaft is None:
            return is_tool, np.zeros(len(points), dtype=bool)
        height = (points - tool.centre) @ tool.shaft
        axis_distance = np.linalg.norm(points - tool.centre - height[:, None] * tool.shaft, axis=1)
        is_shaft = (
            (height > 0) & (height < SHAFT_LENGTH) & (axis_distance < self.tool_radius + slack)
        )
        return is_tool, is_shaft


def _lonely(points: FloatArray) -> Mask:
    """Points (n, 3) with far fewer others in the 27 cells of 2 mm around them than is usual in this
    cloud, (n,).
    """
    if len(points) < 20:
        return np.ones(len(points), dtype=bool)
    cells = np.floor((points - points.min(axis=0)) / VOXEL).astype(np.int64) + 1
    shape = tuple(cells.max(axis=0) + 2)
    flat = np.ravel_multi_index((cells[:, 0], cells[:, 1], cells[:, 2]), shape)
    filled = np.bincount(flat, minlength=int(np.prod(shape))).astype(np.float32).reshape(shape)
    around = uniform_filter(filled, 3, mode="constant").ravel()[flat] * 27
    return np.asarray(around < max(2.5, LONELY * float(np.median(around))))


def locate_tool(points: FloatArray, apart: FloatArray, tool: ToolPose, radius: float) -> ToolPose:
    """The tool moved across its shaft to where the camera sees the shaft; for cleaning only.

    Args:
        points: (n, 3) [m], phantom frame, without the table.
        apart: (n,) [m] their distance from the block.
        tool: as the kinematics say; clocks and calibration may be off by some millimetres.
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
    """Centre (2,) [m] of a circle of about `radius` [m] through points (n, 2), by robust
    Gauss-Newton; a prior keeps arcs tame.
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


def cleaner_for(dataset: Dataset, registration: Registration) -> Cleaner:
    """The cleaner of a dataset: its table from the rest cloud, its noise from the table."""
    pose, config = registration.phantom_from_camera, dataset.config
    camera = registration.camera
    noise = float(np.hypot(camera.noise, camera.bias)) if camera else config.depth_sigma
    stated = Cleaner(
        size=config.size, phantom_from_camera=pose, tool_radius=config.tool_radius, noise=noise
    )
    if not dataset.has_rest:
        return stated
    try:
        table = find_table(dataset.rest_cloud(), max(config.depth_sigma, 1e-3))
    except RegistrationError:
        return stated
    normal = pose.rotate(table.normal)
    offset = table.offset + float(normal @ pose.translation)
    # Another large plane than the table is not taken for it: then z = 0 stands.
    if normal[2] < 0.98 or abs(offset) > 0.01:
        return stated
    return replace(stated, table=(normal, offset))


def tool_poses(
    kinematics: Kinematics,
    times: FloatArray,
    phantom_from_robot: Transform,
    shaft_axis: FloatArray | None,
) -> list[ToolPose]:
    """The tool at `times` (m,) [s]; `shaft_axis` (3,) is the shaft's direction in the tool's own
    frame (see find_shaft_axis).
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
    """Which of the tool frame's six axes (3,) points from the tip along the shaft, by where the
    clouds show points.

    On a dVRK it is -z. None where no axis has at least half of the points that stand clear of block
    and table.
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
