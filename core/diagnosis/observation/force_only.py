"""Observations of sequences that have forces and no clouds.

Two values of each push are used: the force at full depth, averaged over the hold, and the force at
about half of that depth on the way in. The second one separates a body that stiffens from a tool
that came a little deeper than stated. The samples between them carry no further information.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Ordered
from concurrent.futures import Future

import numpy as np

from palpate.dataset import Sequence
from palpate.dataset.tool_smoothing import SMOOTHING, smooth_centres
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.force_record import ForceRecord
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.diagnosis.observation.observe_clouds import observe_all
from palpate.experiment import Experiment
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError
from palpate.foundation.processes import at_once
from palpate.foundation.progress import Report, silent
from palpate.mesh.default_meshes import touched_places
from palpate.setup.phantom_geometry import CLEARANCE
from palpate.setup.setup import Setup

__all__ = ["contact_places", "deepest_rows", "observe_each", "observe_forces", "pushed_places"]

_NO_POINTS = np.empty((0, 3))


def observe_forces(sequence: Sequence, setup: Setup, most: int) -> Observations:
    """Choose the instants of a sequence's pushes that are compared.

    Args:
        sequence: with forces.
        setup: as stated.
        most: largest number of groups.

    Raises DiagnosisError if nothing is pushed, or if the sensor's bias is unknown: the tool is
    never clear of the body, and no push has forces at several depths.
    """
    home = f"sequences/{sequence.name}"
    if sequence.forces is None:
        raise DiagnosisError(
            f"{home}: has neither clouds nor forces; leave it out of [splits]", file=home
        )
    clock, stream = sequence.kinematics, sequence.forces
    gap = _gap(setup, smooth_centres(clock, stream.time))
    begin, end = max(clock.time[0], stream.time[0]), min(clock.time[-1], stream.time[-1])
    times = np.arange(begin, end, CRITERIA.force_only.time_step)
    depth = -_gap(setup, smooth_centres(clock, times)) if len(times) else np.empty(0)
    pushes = _pushes(depth)
    if not pushes:
        deepest = 1e3 * float(depth.max(initial=-np.inf))
        raise DiagnosisError(
            f"{home}: nothing is pressed by {1e3 * CRITERIA.force_only.least_depth:.1f} mm or more "
            f"(at most {deepest:.2f} mm into the phantom as stated); check touches.csv and the "
            "surface, or leave it out of [splits]",
            file=home,
        )
    record = ForceRecord.of(stream, gap > CLEARANCE)
    if record is None:
        spans = [(float(times[run.start]), float(times[run.stop - 1])) for run in pushes]
        record = ForceRecord.of_pushes(stream, -gap, spans)
    if record is None:
        raise DiagnosisError(
            f"{home}/forces.csv: the tool is hardly ever clear of the phantom, so that the "
            "sensor's bias is unknown, and no push has forces at "
            f"{CRITERIA.force_error.least_steps} depths or more over "
            f"{1e3 * CRITERIA.force_error.least_range:.1f} mm to fit its own; record a second or "
            "more before it touches, or more depths of each push",
            file=f"{home}/forces.csv",
        )
    instants, groups = _instants(times, depth, _thinned(pushes, most))
    return Observations(sequence.name, instants, clock, groups, record, force_only=True)


def _gap(setup: Setup, centres: FloatArray) -> FloatArray:
    """Distance (m,) [m] between tool and stated phantom, from centres (m, 3) [m], robot frame."""
    return setup.geometry.facing(setup.phantom_from_robot.apply(centres))[0] - setup.tool.radius


def _pushes(depth: FloatArray) -> list[slice]:
    """Runs of the path (t,) [m] in contact that are deep enough."""
    touching = np.concatenate([[False], depth > 0, [False]])
    edges = np.flatnonzero(np.diff(touching.astype(int)))
    runs = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [run for run in runs if depth[run].max() >= CRITERIA.force_only.least_depth]


def _thinned(pushes: list[slice], most: int) -> list[slice]:
    """Evenly spread pushes, as many as `most` groups can hold."""
    count = max(1, most // (1 + len(CRITERIA.force_only.depth_shares)))
    chosen = np.unique(np.linspace(0, len(pushes) - 1, min(count, len(pushes))).round().astype(int))
    return [pushes[number] for number in chosen]


def _instants(
    times: FloatArray, depth: FloatArray, pushes: list[slice]
) -> tuple[FloatArray, tuple[Group, ...]]:
    """Times (f,) [s] of the instants, and their groups: each push on the way in, and held."""
    instants, groups, count = [], [], 0
    for push, run in enumerate(pushes, start=1):
        own, when = depth[run], times[run]
        full = int(own.argmax())
        for share in CRITERIA.force_only.depth_shares:
            # The last time at which it was shallower, because a tool may hover and come back.
            before = np.flatnonzero(own[: full + 1] < share * own[full])
            if len(before) and before[-1] + 1 < full:
                instants.append(when[before[-1] + 1])
                groups.append(Group((count,), _NO_POINTS, False, push=push))
                count += 1
        held = _held(when, own, full)
        instants += held.tolist()
        groups.append(Group(tuple(range(count, count + len(held))), _NO_POINTS, False, push=push))
        count += len(held)
    return np.array(instants), tuple(groups)


def _held(when: FloatArray, depth: FloatArray, full: int) -> FloatArray:
    """Instants [s] of the hold at full depth, so far apart that their averages share no sample."""
    low = high = full
    while low > 0 and depth[low - 1] > depth[full] - CRITERIA.force_only.hold_tolerance:
        low -= 1
    while (
        high < len(depth) - 1 and depth[high + 1] > depth[full] - CRITERIA.force_only.hold_tolerance
    ):
        high += 1
    room = when[high] - when[low] - 2 * SMOOTHING
    count = (
        int(np.clip(room // (2 * SMOOTHING) + 1, 1, CRITERIA.force_only.most_hold_instants))
        if room > 0
        else 1
    )
    return (
        np.linspace(when[low] + SMOOTHING, when[high] - SMOOTHING, count)
        if count > 1
        else when[full : full + 1]
    )


def pushed_places(data: Ordered[Observations], setup: Setup) -> tuple[FloatArray, FloatArray]:
    """Places (k, 3) [m] of the k pushes without clouds on the stated surface, and the outward
    normals (k, 3).
    """
    places, normals = [], []
    for item in data:
        if not item.force_only:
            continue
        centres = item.centres(setup)
        for push in sorted({group.push for group in item.groups}):
            rows = [row for row, group in enumerate(item.groups) if group.push == push]
            first = centres[rows[0]][None]
            distance, normal = setup.geometry.facing(first)
            places.append(first[0] - distance[0] * normal[0])
            normals.append(normal[0])
    return np.array(places).reshape(-1, 3), np.array(normals).reshape(-1, 3)


def contact_places(data: Ordered[Observations], setup: Setup) -> FloatArray:
    """Places (k, 3) [m] of the stated surface that the tool touches in any sequence.

    Of places in sequences with clouds that are closer to one another than the tool's diameter, one
    is enough.
    """
    places = pushed_places(data, setup)[0]
    for item in data:
        if not item.force_only:
            centres = item.centres(setup)
            places = touched_places(setup.geometry, setup.tool.radius, centres, list(places))
    return places


def deepest_rows(item: Observations) -> list[int]:
    """Number of the group in which each push is held, in the order of the pushes."""
    last = {group.push: row for row, group in enumerate(item.groups)}
    return list(last.values())


def observe_each(
    experiment: Experiment,
    names: Ordered[str],
    setup: Setup,
    most: tuple[int, int],
    report: Report = silent,
    begin: Callable[..., Future[Observations]] = at_once,
) -> list[Observations]:
    """Observe sequences with and without clouds.

    Args:
        experiment: the registered dataset that holds them.
        names: of the sequences.
        setup: as stated, with the robot where it is seen (`Experiment.observation_setup`).
        most: largest number of groups of a sequence with clouds, and of one without.
        report: progress.
        begin: starts a task, as in `observe_all`.
    """
    dataset = experiment.dataset
    seen = [name for name in names if len(dataset.sequence(name))]
    known = observe_all(experiment, seen, setup, most[0], report, begin) if seen else []
    found = {item.name: item for item in known}
    return [
        found[name] if name in found else observe_forces(dataset.sequence(name), setup, most[1])
        for name in names
    ]
