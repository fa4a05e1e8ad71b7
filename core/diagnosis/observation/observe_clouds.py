"""Observation of sequences with clouds: frames are grouped, and their clouds segmented."""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Ordered
from concurrent.futures import Future

import numpy as np

from palpate.dataset import Sequence
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.force_record import ForceRecord
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.experiment import Experiment
from palpate.foundation.arrays import FloatArray
from palpate.foundation.processes import at_once
from palpate.foundation.progress import Report, silent
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.tool_pose import ToolShaft, tool_poses
from palpate.setup.phantom_geometry import CLEARANCE
from palpate.setup.setup import Setup

__all__ = ["observe", "observe_all"]


def _split(centres: FloatArray, free: np.ndarray, times: FloatArray) -> list[list[int]]:
    """Split frames into runs: clear of the phantom and about as long after a release, or near the
    first frame's place (`CRITERIA.grouping.travel`).

    Args:
        centres: (f, 3) of the tool [m].
        free: (f,) whether the tool is clear.
        times: (f,) [s].
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
    """Keep all runs that are clear of the phantom and at most `most` others, evenly spread."""
    touched = [run for run in runs if not free[run[0]]]
    if len(touched) <= most:
        return runs
    retained = {
        id(touched[i])
        for i in np.unique(np.linspace(0, len(touched) - 1, most).round().astype(int))
    }
    return [run for run in runs if free[run[0]] or id(run) in retained]


def observe(
    sequence: Sequence,
    setup: Setup,
    cleaner: Cleaner,
    shaft: ToolShaft | None,
    most: int,
    rest: FloatArray | None = None,
) -> Observations:
    """Group a sequence's frames by the tool's place, and segment their clouds.

    Args:
        sequence: with clouds.
        setup: as stated; its clock places the tool.
        cleaner: segments clouds.
        shaft: of the tool, in its frame; None if unknown.
        most: largest number of groups with the tool near the phantom.
        rest: the raw rest cloud, which becomes the first group.
    """
    kinematics, times = sequence.kinematics, np.asarray(sequence.cloud_times)
    instants = times - setup.sensor.time_offset
    centres = setup.phantom_from_robot.apply(smooth_centres(kinematics, instants))
    free = setup.geometry.distance(centres) > setup.tool.radius + CLEARANCE
    poses = tool_poses(kinematics, instants, setup.phantom_from_robot, shaft)
    groups = (
        [Group((), rest[cleaner.clean(rest).indices], True, True, lowest=cleaner.lowest)]
        if rest is not None
        else []
    )
    pushes = np.cumsum(np.diff(free.astype(int), prepend=1) < 0)
    runs = _thin(_split(centres, free, times), free, most)
    for number, run in enumerate(runs):
        chosen = (
            run
            if len(run) <= CRITERIA.grouping.most_clouds
            else [
                run[i]
                for i in np.linspace(0, len(run) - 1, CRITERIA.grouping.most_clouds)
                .round()
                .astype(int)
            ]
        )
        clouds = [sequence.cloud(frame) for frame in chosen]
        cleaned = [
            raw[cleaner.clean(raw, poses[frame]).indices]
            for frame, raw in zip(chosen, clouds, strict=True)
        ]
        points = np.concatenate(cleaned)
        cloud = np.repeat(np.arange(len(cleaned)), [len(one) for one in cleaned]).astype(np.int16)
        most_points = (
            CRITERIA.grouping.most_points_untouched
            if free[run[0]]
            else CRITERIA.grouping.most_points
        )
        if len(points) > most_points:
            rows = np.random.default_rng(number).choice(len(points), most_points, replace=False)
            points, cloud = points[rows], cloud[rows]
        groups.append(
            Group(
                tuple(chosen),
                points,
                bool(free[run[0]]),
                push=int(pushes[run[0]]),
                lowest=cleaner.lowest,
                cloud=cloud,
            )
        )
    return Observations(sequence.name, times, kinematics, tuple(groups), _forces(sequence, setup))


def _forces(sequence: Sequence, setup: Setup) -> ForceRecord | None:
    """The sequence's forces without bias; None without forces, or if the tool is never clear."""
    if sequence.forces is None:
        return None
    centres = setup.phantom_from_robot.apply(
        smooth_centres(sequence.kinematics, sequence.forces.time)
    )
    return ForceRecord.of(
        sequence.forces, setup.geometry.distance(centres) > setup.tool.radius + CLEARANCE
    )


def observe_all(
    experiment: Experiment,
    names: Ordered[str],
    setup: Setup,
    most: int,
    report: Report = silent,
    begin: Callable[..., Future[Observations]] = at_once,
) -> list[Observations]:
    """Observe sequences with clouds.

    Args:
        experiment: the registered dataset that holds them.
        names: of the sequences.
        setup: as stated, with the robot where it is seen (`Experiment.observation_setup`).
        most: largest number of groups with the tool near the phantom, in each sequence.
        report: progress.
        begin: starts `observe`, for instance in a pool of processes.
    """
    dataset, cleaner, shaft = experiment.dataset, experiment.cleaner, experiment.shaft
    rest = dataset.rest_cloud() if dataset.has_rest else None
    pending, observed = [], []
    for number, name in enumerate(names):
        report(0.5 * number / len(names), f"reading {name}")
        pending.append(begin(observe, dataset.sequence(name), setup, cleaner, shaft, most, rest))
    for number, task in enumerate(pending, start=1):
        observed.append(task.result())
        report(0.5 + 0.5 * number / len(names), f"read {observed[-1].name}")
    return observed
