"""What a sequence says, grouped: frames with the tool at nearly one place share one equilibrium and
one set of patch averages.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Ordered
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Dataset, Kinematics, Sequence
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.force_record import ForceRecord
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.foundation.processes import at_once
from palpate.foundation.progress import Report, silent
from palpate.measurement.segmentation import Cleaner, cleaner_for
from palpate.measurement.tool_pose import find_shaft_axis, tool_poses
from palpate.registration.registration import Registration
from palpate.setup.box import CLEARANCE, distance_to_block
from palpate.setup.setup import Setup

__all__ = ["Group", "Observations", "observe", "observe_all"]

FAR = np.array([0.0, 0.0, 10.0])
"""Where the tool is said to be when there is none [m]."""


def _depth(size: tuple[float, float, float], centres: FloatArray) -> FloatArray:
    """How far points (m, 3) lie below the nearest side of the stated block (m,) [m], negative
    outside; the base does not count.
    """
    sides = np.array([size[0] / 2, size[1] / 2]) - np.abs(centres[:, :2])
    inside = np.minimum(sides.min(axis=1), size[2] - centres[:, 2])
    return np.where(inside > 0, inside, -distance_to_block(size, centres))


@dataclass(frozen=True, eq=False)
class Group:
    """Frames that share one place of the tool.

    Attributes:
        frames: their numbers.
        points: (n, 3) cleaned points of all of them [m], camera frame.
        free: whether the tool is surely clear of the block.
        reference: whether this is the rest cloud instead, taken when the camera was registered and
            without a tool.
        probe: which push of the sequence this belongs to.
        lowest: height of the lowest points of a side that are free of the table's [m].
    """

    frames: tuple[int, ...]
    points: FloatArray
    free: bool
    reference: bool = False
    probe: int = 0
    lowest: float = 0.0


@dataclass(frozen=True, eq=False)
class Observations:
    """One sequence as the diagnosis sees it.

    Attributes:
        times: (f,) cloud stamps [s].
        kinematics: the robot's stream.
        groups: in the order of time.
        forces: on the tool, if they were measured.
        force_only: whether there are no clouds, so that groups hold instants of the pushes and no
            points.
    """

    name: str
    times: FloatArray
    kinematics: Kinematics
    groups: tuple[Group, ...]
    forces: ForceRecord | None = None
    force_only: bool = False

    def centres(self, setup: Setup) -> FloatArray:
        """Stated tool centre (g, 3) [m] of each group, phantom frame, under the setup's clock and
        registration.
        """
        places = self._places(setup)
        return np.array(
            [places[list(g.frames)].mean(axis=0) if g.frames else FAR for g in self.groups]
        )

    def _places(self, setup: Setup) -> FloatArray:
        """The same (f, 3) [m] of each frame."""
        return setup.phantom_from_robot.apply(
            smooth_centres(self.kinematics, self.times - setup.sensor.time_offset)
        )

    def instant(self, group: Group, setup: Setup) -> float | None:
        """When a group's frames were taken, on the robot's clock [s]; None for the rest cloud."""
        return (
            float(self.times[list(group.frames)].mean()) - setup.sensor.time_offset
            if group.frames
            else None
        )

    def grouping_holds(self, setup: Setup) -> bool:
        """Whether under this setup's clock every frame was taken about where its group is replayed.

        That is within TRAVEL of the group's place, or with the tool out of touch where it is said
        to be clear of the block.
        """
        if self.force_only:
            return True
        places = self._places(setup)
        for group, centre in zip(self.groups, self.centres(setup), strict=True):
            own = places[list(group.frames)]
            if group.free and (distance_to_block(setup.box.size, own) < setup.tool.radius).any():
                return False
            if (
                not group.free
                and (np.linalg.norm(own - centre, axis=1) > CRITERIA.grouping.travel).any()
            ):
                return False
        return True

    def path(self, setup: Setup) -> tuple[FloatArray, FloatArray]:
        """Times (t,) [s] of the recording, on the robot's clock, and stated tool centres (t, 3)
        [m], phantom frame.
        """
        times = (
            np.arange(self.times[0], self.times[-1], CRITERIA.grouping.path_step)
            - setup.sensor.time_offset
        )
        return times, setup.phantom_from_robot.apply(smooth_centres(self.kinematics, times))

    def force_in_groups(
        self, phantom_from_robot: Transform, late: float
    ) -> tuple[FloatArray, FloatArray] | None:
        """Force on the tool (g, 3) [N] in each group, phantom frame, and its standard deviation
        (g,) [N]; NaN where none is known.

        `late` is the cloud stamp minus the robot's of one instant [s]. Forces and poses have one
        clock. Where the camera's is off, both are those of another instant, and still of the same
        one.
        """
        if self.forces is None:
            return None
        measured, strayed = self.forces.at(self.times - late)
        frames = [list(group.frames) for group in self.groups]
        force = np.array(
            [measured[one].mean(axis=0) if one else np.full(3, np.nan) for one in frames]
        )
        variance = [
            self.forces.white / len(one) + strayed[one].mean() if one else np.nan for one in frames
        ]
        return force @ phantom_from_robot.rotation.T, np.sqrt(variance)

    def deepest_places(self, setup: Setup) -> list[int | None]:
        """For each group at which place of the `path` the tool was deepest since the group before;
        None where that is its own place.

        A base that slides has gone as far as the deepest push took it, whether a cloud was taken
        there or not.
        """
        times, way = self.path(setup)
        depths = _depth(setup.box.size, way)
        found: list[int | None] = []
        last = np.inf
        for group, centre in zip(self.groups, self.centres(setup), strict=True):
            instant = self.instant(group, setup)
            now = np.inf if instant is None else instant
            between = np.flatnonzero((times > last) & (times <= now))
            last = now
            deepest = int(between[np.argmax(depths[between])]) if len(between) else None
            deeper = (
                deepest is not None
                and depths[deepest]
                > _depth(setup.box.size, centre[None])[0] + CRITERIA.grouping.deeper_by
            )
            found.append(deepest if deeper else None)
        return found


def _split(centres: FloatArray, free: np.ndarray, times: FloatArray) -> list[list[int]]:
    """Runs of frames: all clear of the block, and about as long after a release; or within TRAVEL
    of the run's first.
    """
    runs: list[list[int]] = []
    released = -np.inf
    since = np.zeros(len(times), dtype=int)
    for frame, centre in enumerate(centres):
        last = runs[-1] if runs else None
        released = released if free[frame] else times[frame]
        since[frame] = np.searchsorted(CRITERIA.grouping.recovery_times, times[frame] - released)
        joins = (
            last is not None
            and free[last[0]] == free[frame]
            and (not free[frame] or since[last[0]] == since[frame])
        )
        if (
            joins
            and last is not None
            and (
                free[frame] or np.linalg.norm(centre - centres[last[0]]) < CRITERIA.grouping.travel
            )
        ):
            last.append(frame)
        else:
            runs.append([frame])
    return runs


def _thin(runs: list[list[int]], free: np.ndarray, most: int) -> list[list[int]]:
    """Keep all runs clear of the block and at most `most` of the others, evenly spread."""
    touched = [run for run in runs if not free[run[0]]]
    if len(touched) <= most:
        return runs
    kept = {
        id(touched[i])
        for i in np.unique(np.linspace(0, len(touched) - 1, most).round().astype(int))
    }
    return [run for run in runs if free[run[0]] or id(run) in kept]


def observe(
    sequence: Sequence,
    setup: Setup,
    cleaner: Cleaner,
    shaft: FloatArray | None,
    most: int,
    rest: FloatArray | None = None,
) -> Observations:
    """Group a sequence's frames by where the tool was under the setup's clock, and clean their
    clouds.

    Args:
        most: groups with the tool near the block, at most.
        rest: the raw rest cloud, which becomes the first group.
    """
    kinematics, times = sequence.kinematics, np.asarray(sequence.cloud_times)
    instants = times - setup.sensor.time_offset
    centres = setup.phantom_from_robot.apply(smooth_centres(kinematics, instants))
    free = distance_to_block(setup.box.size, centres) > setup.tool.radius + CLEARANCE
    poses = tool_poses(kinematics, instants, setup.phantom_from_robot, shaft)
    groups = (
        [Group((), rest[cleaner.clean(rest).indices], True, True, lowest=cleaner.lowest)]
        if rest is not None
        else []
    )
    probes = np.cumsum(np.diff(free.astype(int), prepend=1) < 0)
    runs = _thin(_split(centres, free, times), free, most)
    for number, run in enumerate(runs):
        picked = (
            run
            if len(run) <= CRITERIA.grouping.most_clouds
            else [
                run[i]
                for i in np.linspace(0, len(run) - 1, CRITERIA.grouping.most_clouds)
                .round()
                .astype(int)
            ]
        )
        clouds = [sequence.cloud(frame) for frame in picked]
        points = np.concatenate(
            [
                raw[cleaner.clean(raw, poses[frame]).indices]
                for frame, raw in zip(picked, clouds, strict=True)
            ]
        )
        room = (
            CRITERIA.grouping.most_points_untouched
            if free[run[0]]
            else CRITERIA.grouping.most_points
        )
        if len(points) > room:
            points = points[np.random.default_rng(number).choice(len(points), room, replace=False)]
        groups.append(
            Group(
                tuple(picked),
                points,
                bool(free[run[0]]),
                probe=int(probes[run[0]]),
                lowest=cleaner.lowest,
            )
        )
    return Observations(sequence.name, times, kinematics, tuple(groups), _forces(sequence, setup))


def _forces(sequence: Sequence, setup: Setup) -> ForceRecord | None:
    """The sequence's forces without their bias, which shows wherever the tool is clear of the block
    as stated.
    """
    if sequence.forces is None:
        return None
    centres = setup.phantom_from_robot.apply(
        smooth_centres(sequence.kinematics, sequence.forces.time)
    )
    return ForceRecord.of(
        sequence.forces, distance_to_block(setup.box.size, centres) > setup.tool.radius + CLEARANCE
    )


def observe_all(
    dataset: Dataset,
    names: Ordered[str],
    setup: Setup,
    registration: Registration,
    most: int,
    report: Report = silent,
    begin: Callable[..., Future[Observations]] = at_once,
) -> list[Observations]:
    """Observations of these sequences; `begin` is where `observe` is carried out, as in a pool of
    processes.
    """
    cleaner, shaft = cleaner_for(dataset, registration), find_shaft_axis(dataset, registration)
    rest = dataset.rest_cloud() if dataset.has_rest else None
    pending, found = [], []
    for number, name in enumerate(names):
        report(0.5 * number / len(names), f"reading {name}")
        pending.append(begin(observe, dataset.sequence(name), setup, cleaner, shaft, most, rest))
    for number, task in enumerate(pending, start=1):
        found.append(task.result())
        report(0.5 + 0.5 * number / len(names), f"read {found[-1].name}")
    return found
