"""One recording on one clock: tool, forces, contacts, touches, and the clouds that are shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.dataset.tool_motion import averaged_path
from palpate.first_look.series import as_list, extreme_rows
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.clocks.stream_times import StreamTimes
from palpate.importing.cutting.dwells import find_dwells
from palpate.importing.cutting.pushes import AT_TOUCH, LocatedPhantom
from palpate.importing.cutting.rest_average import untouched_clouds
from palpate.importing.force_in_robot import forces_in_robot
from palpate.importing.import_notes import ImportNotes
from palpate.importing.rules import ImportMapping
from palpate.importing.timed_recording import TimedRecording

__all__ = ["MotionSeries", "cloud_choice", "without_poses"]

_MOST_RAW = 60_000
"""Poses beyond which a path is averaged over short steps before its extremes are looked for."""


def without_poses(
    name: str, mapping: ImportMapping, times: dict[str, StreamTimes]
) -> TimedRecording:
    """A recording of which only the stamps of clouds are taken."""
    none, cloud = np.empty(0, dtype=np.int64), times.get(mapping.streams.cloud)
    return TimedRecording(
        name=name,
        pose_times=none,
        positions=np.empty((0, 3)),
        quaternions=np.empty((0, 4)),
        cloud_rows=none if cloud is None else cloud.rows,
        cloud_times=none if cloud is None else cloud.times,
        wrench_times=none,
        forces=np.empty((0, 3)),
        uncertainty=0.0,
    )


@dataclass(frozen=True)
class MotionSeries:
    """Series of one recording for display.

    Attributes:
        timed: the recording on one clock.
        phantom: as the robot finds it; None where nothing relates them.
        most: rows of a series.
    """

    timed: TimedRecording
    phantom: LocatedPhantom | None
    most: int

    @property
    def has_poses(self) -> bool:
        """Whether there is a path of the tool."""
        return len(self.timed.pose_times) > 1

    def places(self) -> FloatArray:
        """Tool centres (n, 3) [m]: phantom frame where it is known, else robot frame."""
        if self.phantom is None:
            return self.timed.positions
        return self.phantom.in_phantom(self.timed)

    def axes(self, along: FloatArray | None) -> FloatArray:
        """Directions (n, 3) of the shaft at the poses, in the frame of `places`.

        Args:
            along: (3,) unit vector of the shaft in the tool's own frame; None where it is not
                known, which gives (0, 3).
        """
        if along is None:
            return np.zeros((0, 3))
        turned = np.asarray(Rotation.from_quat(self.timed.quaternions).apply(along))
        return turned if self.phantom is None else self.phantom.phantom_from_robot.rotate(turned)

    def tool(self) -> dict[str, Any]:
        """Path of the tool with its depth in the stated surface, as in look.json."""
        if not self.has_poses:
            return {"t": [], "x": [], "y": [], "z": [], "depth": None, "frame": "robot"}
        time, path = self.timed.time, self.places()
        if len(time) > _MOST_RAW:
            time, path = averaged_path(time, path)
        depth = None
        if self.phantom is not None:
            depth = self.phantom.radius - self.phantom.geometry.facing(path)[0]
        rows = extreme_rows(path if depth is None else depth[:, None], self.most)
        return {
            "t": as_list(time[rows]),
            **{axis: as_list(path[rows, at]) for at, axis in enumerate("xyz")},
            "depth": None if depth is None else as_list(depth[rows]),
            "frame": "robot" if self.phantom is None else "phantom",
        }

    def force(self, mapping: ImportMapping, notes: ImportNotes) -> dict[str, Any] | None:
        """Forces, in the robot frame where it is stated how, else as recorded; None without."""
        timed = self.timed
        if not len(timed.forces):
            return None
        try:
            contacts = self.phantom.contacts(timed)[0] if self.phantom and self.has_poses else ()
            until = contacts[0].start if contacts else timed.wrench_times[-1] / 1e9
            forces, frame = forces_in_robot(timed, mapping.wrench, until, notes), "robot"
        except DatasetError as error:
            notes.warn(f"forces are shown as recorded: {error.message}")
            forces, frame = timed.forces, "sensor"
        rows = extreme_rows(forces, self.most)
        return {
            "t": as_list(timed.wrench_times[rows] / 1e9),
            **{f"f{axis}": as_list(forces[rows, at], 4) for at, axis in enumerate("xyz")},
            "frame": frame,
        }

    def touches(self) -> list[dict[str, Any]]:
        """Dwells at touched landmarks."""
        if self.phantom is None or not len(self.phantom.touched) or not self.has_poses:
            return []
        dwells, found = find_dwells(self.timed), []
        for name, place in zip(self.phantom.landmarks, self.phantom.touched, strict=True):
            near = np.linalg.norm(dwells.places - place, axis=1) < AT_TOUCH
            for at in np.flatnonzero(near):
                start, end = as_list(np.array([dwells.starts[at], dwells.ends[at]]))
                found.append({"start": start, "end": end, "landmark": name})
        return sorted(found, key=lambda one: one["start"])

    def rest(self, most: int) -> list[float] | None:
        """Start and end [s] of the clouds that would be averaged to the rest cloud."""
        if not len(self.timed.cloud_times):
            return None
        chosen, _ = untouched_clouds(self.timed, self.phantom if self.has_poses else None, most)
        if not len(chosen):
            return None
        return as_list(self.timed.cloud_times[chosen[[0, -1]]] / 1e9)

    def deepest(self) -> FloatArray:
        """Times (k,) [s] at which the contacts are deepest."""
        if self.phantom is None or not self.has_poses:
            return np.zeros(0)
        contacts, gap = self.phantom.contacts(self.timed)
        time, _ = averaged_path(self.timed.time, self.places())
        found = []
        for one in contacts:
            inside = np.flatnonzero((time >= one.start) & (time <= one.end))
            found.append(float(time[inside[np.argmin(gap[inside])]]))
        return np.array(found)


def cloud_choice(times: FloatArray, deepest: FloatArray, most: int) -> list[int]:
    """Numbers of the clouds that are shown: those nearest to the deepest contacts, others spread
    evenly.

    Args:
        times: (n,) of all clouds [s].
        deepest: (k,) times of the deepest contacts [s].
        most: number of clouds.
    """
    if len(times) <= most:
        return list(range(len(times)))
    at = {int(np.abs(times - one).argmin()) for one in deepest}
    chosen = set(sorted(at)[:: 1 + (len(at) - 1) // most] if at else [])
    even = np.unique(np.linspace(0, len(times) - 1, max(0, most - len(chosen))).astype(int))
    return sorted(chosen | set(even.tolist()))
