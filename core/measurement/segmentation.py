"""Segmentation of the phantom in raw clouds.

Points of table, tool, shaft and background and stray points are removed and counted. What does not
change between frames is found once: the table by RANSAC in the rest cloud, the direction of the
shaft in the tool's frame. Each frame then takes a few vectorised tests. The tests allow for noise
along the line of sight, since a depth camera has hardly any across it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np
from scipy.ndimage import uniform_filter

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.measurement.hole_rims import beside_holes
from palpate.measurement.tool_pose import SHAFT_LENGTH, ShaftSight, ToolPose, locate_tool
from palpate.registration.camera.table_plane import find_table
from palpate.registration.registration import Registration
from palpate.registration.shape.seen_body import SeenBody
from palpate.setup.phantom_geometry import Geometry

__all__ = ["REASONS", "CleanCloud", "Cleaner", "cleaner_for"]

IndexArray = np.ndarray[Any, np.dtype[np.int64]]
Mask = np.ndarray[Any, np.dtype[np.bool_]]
ReasonArray = np.ndarray[Any, np.dtype[np.int8]]

REASONS = ("kept", "table", "tool", "shaft", "background", "stray", "hole", "holder")
"""Labels of points: the phantom's ("kept"), and why others are removed."""
SIGMAS = 3.0
"""Standard deviations of noise that the tests allow for [1]."""
POSE_ERROR = 5.0e-4
"""Error of the tool's position [m] after `locate_tool`; widens the tests on tool and shaft."""
_HOLDER, _HEAVE = 4.0e-3, 0.5e-3
"""How far beyond the tool's radius parts of the tool are looked for, and how far a pressed phantom
may stand out around the tool [m]."""
TABLE_REACH = 0.08
"""Distance from the phantom up to which points of the table are used [m]."""
FARTHEST_TABLE, FEWEST_ON_TABLE = 8.0e-3, 100
"""Largest height of points [m], and least number of them, for a correction of the table's plane."""
VOXEL = 2.0e-3
"""Width of the cells in which neighbours are counted [m]."""
LONELY = 0.2
"""Neighbours over the median number of neighbours below which a point is stray [1]."""


@dataclass(frozen=True, eq=False)
class CleanCloud:
    """The phantom's points of one raw cloud.

    Attributes:
        points: (n, 3) [m], phantom frame.
        indices: (n,) rows of the raw cloud.
        table_points: (m, 3) [m] of the table around the phantom, phantom frame.
        counts: number of points for each of REASONS.
        reasons: (k,) of every point of the raw cloud, as an index into REASONS.
    """

    points: FloatArray
    indices: IndexArray
    table_points: FloatArray
    counts: dict[str, int]
    reasons: ReasonArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Cleaner:
    """Segments the clouds of one dataset.

    Attributes:
        geometry: of the phantom at rest.
        phantom_from_camera: pose of the camera.
        tool_radius: of the sphere, as stated [m].
        tool_radii: smallest and largest radius [m] that the tool may have; as stated if None.
        noise: standard deviation of depth along the line of sight [m].
        table: normal (3,) and offset [m] of the table, phantom frame; z = 0 unless the rest cloud
            shows another plane. Each frame that shows enough of the table corrects it.
        bulge: distance that the deformed or slid phantom may reach beyond its rest shape [m].
    """

    geometry: Geometry
    phantom_from_camera: Transform
    tool_radius: float
    noise: float
    table: tuple[FloatArray, float] = (np.array([0.0, 0.0, 1.0]), 0.0)
    bulge: float = 0.01
    tool_radii: tuple[float, float] | None = None

    def allowing(self, *radii: float) -> Self:
        """A cleaner that removes the tool also if it has one of these radii [m].

        Points on a tool that is larger than stated else count as the phantom's: they lie
        millimetres off its surface under any model, the true one included.
        """
        known = (self.tool_radius, *(self.tool_radii or ()), *radii)
        return replace(self, tool_radii=(min(known), max(known)))

    def clean(self, cloud: FloatArray, tool: ToolPose | None = None) -> CleanCloud:
        """Extract the phantom's points from a raw cloud (n, 3) [m], camera frame.

        Without a `tool`, no points of tool and shaft are removed.
        """
        points = self.phantom_from_camera.apply(cloud)
        reason = np.zeros(len(points), dtype=np.int8)
        apart = self.geometry.outside(points)
        height = self._height(points, apart)
        thickness = self._thickness
        reason[apart > self.bulge] = REASONS.index("background")
        on_table = np.abs(height) < thickness
        reason[height < thickness] = REASONS.index("background")
        reason[on_table] = REASONS.index("table")
        reason[self._on_holder(points)] = REASONS.index("holder")
        if tool is not None:
            camera = self.phantom_from_camera.translation
            near = np.flatnonzero(
                (reason != REASONS.index("table")) & (reason != REASONS.index("holder"))
            )
            located = locate_tool(points[near], apart[near], tool, camera, self._slack)
            is_tool, is_shaft = self._tool_points(points[near], located)
            is_tool |= self._beside_tool(points[near], apart[near], located)
            reason[near[is_tool]] = REASONS.index("tool")
            reason[near[is_shaft & ~is_tool]] = REASONS.index("shaft")
        phantom = np.flatnonzero(reason == 0)
        lonely = _lonely(points[phantom], self.phantom_from_camera.translation, self.noise)
        reason[phantom[lonely]] = REASONS.index("stray")
        reason[self._beside_holes(points, reason == 0)] = REASONS.index("hole")
        indices = np.flatnonzero(reason == 0)
        counts = np.bincount(reason, minlength=len(REASONS))
        return CleanCloud(
            points[indices],
            indices,
            points[on_table & (apart > thickness) & (apart < TABLE_REACH)],
            {name: int(count) for name, count in zip(REASONS, counts, strict=True)},
            reason,
        )

    def _on_holder(self, points: FloatArray) -> Mask:
        """Mask (n,) of points (n, 3) [m], phantom frame, whose line of sight ends on a rigid thing
        in front of the undeformed phantom.

        The line of sight alone decides, not the noisy depth, so that what is kept has no bias.
        """
        if not self.geometry.in_view:
            return np.zeros(len(points), dtype=bool)
        hits = SeenBody(self.geometry).cast(*self._sights(points))
        return hits.hidden

    def _sights(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The camera's centre (3,) [m] and unit vectors (n, 3) to points (n, 3) [m]."""
        camera = self.phantom_from_camera.translation
        ways = points - camera
        return camera, ways / np.maximum(np.linalg.norm(ways, axis=1, keepdims=True), 1e-9)

    def _beside_holes(self, points: FloatArray, asked: Mask) -> Mask:
        """Mask (n,) of the asked points (n, 3) [m], phantom frame, at the rim of holes."""
        return beside_holes(self._sights(points)[1], asked)

    @property
    def lowest(self) -> float:
        """Height over the table [m] below which noise decides whether a point counts as the
        table's.

        The points of a side below it are those that noise has lifted, so their distances are
        biased outwards.
        """
        return 2 * self._thickness

    @property
    def _thickness(self) -> float:
        """Distance from the table's plane up to which a point counts as the table's [m]."""
        return max(SIGMAS * self.noise * self._table_slant(), 1.0e-3)

    def _height(self, points: FloatArray, apart: FloatArray) -> FloatArray:
        """Height (n,) [m] over the table of this frame.

        The plane is refitted robustly, because a camera that was bumped sees it tilted and shifted.
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

    @property
    def _slack(self) -> float:
        """Distance [m] along the line of sight up to which a point counts as the tool's."""
        return SIGMAS * self.noise + POSE_ERROR

    def _table_slant(self) -> float:
        """Cosine between the table's normal and the line of sight to the block [1]: the part of
        depth noise that is height.
        """
        sight = self.phantom_from_camera.translation
        return float(abs(self.table[0] @ sight) / max(float(np.linalg.norm(sight)), 1e-9))

    def _beside_tool(self, points: FloatArray, apart: FloatArray, tool: ToolPose) -> Mask:
        """Mask (n,) of points (n, 3) [m] near the tool's axis that lie outside the undeformed
        phantom by more than noise: a tool larger than stated, a neck, a holder.

        Args:
            points: phantom frame.
            apart: (n,) distance from the undeformed phantom [m].
            tool: as located.
        """
        offset = points - tool.centre
        height = offset @ tool.shaft.axis if tool.shaft else np.zeros(len(points))
        if tool.shaft is not None:
            offset = offset - np.maximum(height, 0.0)[:, None] * tool.shaft.axis
        reach = self.tool_radius + _HOLDER
        return np.asarray((np.linalg.norm(offset, axis=1) < reach) & (apart > self._slack + _HEAVE))

    def _tool_points(self, points: FloatArray, tool: ToolPose) -> tuple[Mask, Mask]:
        """Masks (n,) of points (n, 3) [m], phantom frame, on the sphere and on the shaft.

        A line of sight through the sphere ends on its front. A point farther back along it, beyond
        noise, was seen past a tool whose position has an error. It belongs to the surface and is
        kept.
        """
        camera = self.phantom_from_camera.translation
        sight = points - camera
        depth = np.linalg.norm(sight, axis=1)
        sight /= np.maximum(depth, 1e-9)[:, None]
        to_centre = tool.centre - camera
        along = sight @ to_centre
        across = np.sqrt(np.maximum(to_centre @ to_centre - along**2, 0.0))
        thinnest, thickest = self.tool_radii or (self.tool_radius, self.tool_radius)
        nearest, farthest = (
            along - np.sqrt(np.maximum(radius**2 - across**2, 0.0))
            for radius in (thickest, thinnest)
        )
        slack = self._slack
        is_tool = across < thickest + POSE_ERROR
        is_tool &= (depth - nearest > -slack) & (depth - farthest < slack)
        if tool.shaft is None:
            return is_tool, np.zeros(len(points), dtype=bool)
        seen = ShaftSight.of(camera, sight, tool, tool.shaft)
        is_shaft = (seen.height > 0) & (seen.height < SHAFT_LENGTH)
        is_shaft &= np.abs(seen.across) < tool.shaft.radius + POSE_ERROR
        is_shaft &= np.abs(depth - seen.front) < slack
        return is_tool, is_shaft


def _lonely(points: FloatArray, camera: FloatArray, noise: float) -> Mask:
    """Mask (n,) of points (n, 3) [m] with far fewer neighbours in the 27 cells around them than the
    median point of the cloud.

    Cells are VOXEL wide across the lines of sight from `camera` (3,) [m]. Along them they are at
    least two standard deviations of `noise` [m] long: in shorter ones a point would be lonely by
    its noise, and the points that are left would have less noise than the sensor, or a bias.
    """
    if len(points) < 20:
        return np.ones(len(points), dtype=bool)
    away = points - camera
    depth = np.linalg.norm(away, axis=1)
    middle = away.mean(axis=0) / max(float(np.linalg.norm(away.mean(axis=0))), 1e-9)
    across = np.linalg.svd(middle[None])[2][1:]
    flat = (away / np.maximum(depth, 1e-9)[:, None]) @ across.T * float(depth.mean())
    scaled = np.column_stack([flat / VOXEL, depth / max(VOXEL, 2 * noise)])
    cells = np.floor(scaled - scaled.min(axis=0)).astype(np.int64) + 1
    shape = tuple(cells.max(axis=0) + 2)
    rows = np.ravel_multi_index((cells[:, 0], cells[:, 1], cells[:, 2]), shape)
    filled = np.bincount(rows, minlength=int(np.prod(shape))).astype(np.float32).reshape(shape)
    around = uniform_filter(filled, 3, mode="constant").ravel()[rows] * 27
    return np.asarray(around < max(2.5, LONELY * float(np.median(around))))


def cleaner_for(dataset: Dataset, registration: Registration) -> Cleaner:
    """The cleaner of a dataset, with table and noise from the rest cloud."""
    pose, config = registration.phantom_from_camera, dataset.config
    camera = registration.camera
    noise = float(np.hypot(camera.noise, camera.bias)) if camera else config.depth_sigma
    stated = Cleaner(
        geometry=dataset.geometry,
        phantom_from_camera=pose,
        tool_radius=config.tool_radius,
        noise=noise,
    )
    if not dataset.has_rest:
        return stated
    try:
        table = find_table(dataset.rest_cloud(), max(config.depth_sigma, 1e-3))
    except RegistrationError:
        return stated
    normal = pose.rotate(table.normal)
    offset = table.offset + float(normal @ pose.translation)
    # A large plane that is not near z = 0 is not the table.
    if normal[2] < 0.98 or abs(offset) > 0.01:
        return stated
    return replace(stated, table=(normal, offset))
