"""Observations of a sequence in groups of frames.

Frames with the tool at nearly one place share one equilibrium and one set of patch averages.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.dataset import Kinematics
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.force_record import ForceRecord
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.frames import Transform
from palpate.setup.setup import Setup

__all__ = ["FAR", "Group", "Observations"]

FAR = np.array([0.0, 0.0, 10.0])
"""Place that stands for a tool which is not there [m]."""


@dataclass(frozen=True, eq=False)
class Group:
    """Frames that share one place of the tool.

    Attributes:
        frames: their numbers.
        points: (n, 3) segmented points of all of them [m], camera frame.
        free: whether the tool is surely clear of the phantom.
        reference: whether this is the rest cloud, which was taken without a tool when the camera
            was registered.
        push: number of the push that the group belongs to; 0 before the first.
        lowest: height of the lowest points of a side that are surely not of the table [m].
        cloud: (n,) number of each point's cloud among the group's; empty if unknown.
    """

    frames: tuple[int, ...]
    points: FloatArray
    free: bool
    reference: bool = False
    push: int = 0
    lowest: float = 0.0
    cloud: IntArray = field(default_factory=lambda: np.zeros(0, dtype=np.int16))


@dataclass(frozen=True, eq=False)
class Observations:
    """One sequence as the diagnosis uses it.

    Attributes:
        name: of the sequence.
        times: (f,) stamps of the clouds, or instants of the pushes [s].
        kinematics: the robot's stream.
        groups: in the order of time.
        forces: on the tool; None where none were measured.
        force_only: whether there are forces and no clouds, so that groups have no points.
    """

    name: str
    times: FloatArray
    kinematics: Kinematics
    groups: tuple[Group, ...]
    forces: ForceRecord | None = None
    force_only: bool = False

    def centres(self, setup: Setup) -> FloatArray:
        """Stated tool centre (g, 3) [m] of each group, phantom frame, by the setup's clock and
        registration.
        """
        places = self._places(setup)
        return np.array(
            [places[list(g.frames)].mean(axis=0) if g.frames else FAR for g in self.groups]
        )

    def _places(self, setup: Setup) -> FloatArray:
        """Stated tool centre (f, 3) [m] of each frame, phantom frame."""
        return setup.phantom_from_robot.apply(
            smooth_centres(self.kinematics, self.times - setup.sensor.time_offset)
        )

    def instant(self, group: Group, setup: Setup) -> float | None:
        """Mean time of a group's frames on the robot's clock [s]; None for the rest cloud."""
        return (
            float(self.times[list(group.frames)].mean()) - setup.sensor.time_offset
            if group.frames
            else None
        )

    def grouping_holds(self, setup: Setup) -> bool:
        """Whether the grouping is valid under this setup's clock.

        It is valid if the tool of every frame is near its group's place
        (`CRITERIA.grouping.travel`), or out of contact in a group that counts as clear.
        """
        if self.force_only:
            return True
        places = self._places(setup)
        for group, centre in zip(self.groups, self.centres(setup), strict=True):
            own = places[list(group.frames)]
            if group.free and (setup.geometry.distance(own) < setup.tool.radius).any():
                return False
            if (
                not group.free
                and (np.linalg.norm(own - centre, axis=1) > CRITERIA.grouping.travel).any()
            ):
                return False
        return True

    def path(self, setup: Setup) -> tuple[FloatArray, FloatArray]:
        """Sample the tool's path: times (t,) [s] on the robot's clock, and stated tool centres
        (t, 3) [m], phantom frame.
        """
        times = (
            np.arange(self.times[0], self.times[-1], CRITERIA.grouping.path_step)
            - setup.sensor.time_offset
        )
        return times, setup.phantom_from_robot.apply(smooth_centres(self.kinematics, times))

    def force_in_groups(
        self, phantom_from_robot: Transform, late: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """Measured force on the tool (g, 3) [N] in each group, phantom frame, and its standard
        deviation (g,) [N]; NaN where none is known. None without a force record.

        Args:
            phantom_from_robot: pose of the robot.
            late: cloud stamp minus robot stamp of one instant [s]. Forces and poses have one
                clock, so that both are those of the same instant whatever the camera's clock is.
        """
        if self.forces is None:
            return None
        measured, bias_variance = self.forces.at(self.times - late)
        frames = [list(group.frames) for group in self.groups]
        force = np.array(
            [measured[one].mean(axis=0) if one else np.full(3, np.nan) for one in frames]
        )
        variance = [
            self.forces.white / len(one) + bias_variance[one].mean() + self.forces.offset**2
            if one
            else np.nan
            for one in frames
        ]
        return force @ phantom_from_robot.rotation.T, np.sqrt(variance)

    def deepest_places(self, setup: Setup) -> list[int | None]:
        """For each group the place on `path` at which the tool was deepest since the group before;
        None where that is the group's own place.

        The deepest push determines how far a base slides, even if no cloud was taken there.
        """
        times, path = self.path(setup)
        depths = -setup.geometry.facing(path)[0]
        own = -setup.geometry.facing(self.centres(setup))[0]
        places: list[int | None] = []
        last = np.inf
        for group, depth in zip(self.groups, own, strict=True):
            instant = self.instant(group, setup)
            now = np.inf if instant is None else instant
            between = np.flatnonzero((times > last) & (times <= now))
            last = now
            deepest = int(between[np.argmax(depths[between])]) if len(between) else None
            deeper = deepest is not None and depths[deepest] > depth + CRITERIA.grouping.deeper_by
            places.append(deepest if deeper else None)
        return places
