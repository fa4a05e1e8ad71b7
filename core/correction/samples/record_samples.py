"""Samples from a dataset: a model is replayed along the recorded motion, and its shape is kept
beside what the camera saw.
"""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.sample_arrays import SampleWriter
from palpate.correction.samples.sample_store import FORMAT, Samples, open_samples
from palpate.dataset import Dataset
from palpate.dataset import Sequence as Recording
from palpate.dataset.tool_smoothing import SMOOTHING, averaged, smooth_centres
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import CorrectionError, RunError
from palpate.foundation.frames import Transform
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, part, silent
from palpate.measurement.camera_model import Sight, sight_of
from palpate.measurement.phantom_drift import as_it_stood
from palpate.measurement.segmentation import Cleaner, cleaner_for, find_shaft_axis, tool_poses
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.graded_mesh import PAGE_GRID
from palpate.mesh.protocol import Meshing
from palpate.mesh.stored_label import stored_label
from palpate.registration.registration import Registration, register, setup_from
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.box import CLEARANCE, distance_to_block
from palpate.setup.setup import Setup

__all__ = ["Recorder", "canonical_quaternions", "make_samples", "recorder_for", "tool_columns"]

TOLERANCE = 1e-3
"""Residual at which a frame counts as converged, over the push [1]; as in the page's replays."""


@dataclass(frozen=True, eq=False)
class Recorder:
    """What turns the frames of a dataset into samples under one setup.

    Attributes:
        dataset: with each sequence as seen from the block where it stood.
        setup: the model.
        grid: its mesh.
        body: what is sampled of it.
        cleaner, shaft: take the phantom out of the clouds.
        points: kept of a cloud, at most.
        measured: whether forces are those of the sensor.
        seed: of what is drawn.
    """

    dataset: Dataset
    setup: Setup
    grid: Meshing
    body: Body
    cleaner: Cleaner
    shaft: FloatArray | None
    points: int
    measured: bool
    seed: int = 0

    @property
    def phantom_from_robot(self) -> Transform:
        """The robot registration under the setup, corrected for the sag at the touches."""
        return touch_correction(self.setup, self.grid) @ self.setup.phantom_from_robot

    def only(self, name: str) -> Recorder:
        """The same with one sequence alone, to be sent to a process."""
        return replace(self, dataset=replace(self.dataset, loaded=(self.dataset.sequence(name),)))


def recorder_for(
    dataset: Dataset,
    *,
    setup: Setup | None = None,
    grid: Meshing | None = None,
    nodes: tuple[int, int, int] = (13, 5, 5),
    body: Body | None = None,
    points: int = 1024,
    seed: int = 0,
    registration: Registration | None = None,
) -> Recorder:
    """How samples of a dataset are made.

    Args:
        setup: the model; the stated one with the registrations found when left out.
        grid: its mesh; that of the page when left out.
        nodes: of the grid that is sampled, along x, y, z.
        body: instead of a grid.
        registration: if it is known already.
    """
    dataset, registration = as_it_stood(dataset, registration or register(dataset))
    setup = setup or setup_from(dataset, registration)
    felt = [dataset.sequence(name).forces is not None for name in dataset.sequences]
    return Recorder(
        dataset,
        setup,
        grid or PAGE_GRID.for_tool(setup.tool.radius),
        body or Body.block(setup.box.size, nodes),
        cleaner_for(dataset, registration),
        find_shaft_axis(dataset, registration),
        points,
        all(felt),
        seed,
    )


def make_samples(
    folder: Path,
    recorder: Recorder,
    *,
    sequences: Sequence[str] | None = None,
    every: int = 1,
    workers: int = 1,
    report: Report = silent,
) -> Samples:
    """Replay the sequences and write their samples to `folder`: whole or not at all.

    Args:
        folder: does not exist yet, nor by the time all is made, or RunError.
        sequences: all with clouds when left out.
        every: each how many clouds one is taken.
        workers: processes.

    A frame without equilibrium, or of which fewer than 20 points are left, is no sample;
    samples.json says how many there were.
    """
    if folder.exists():
        raise RunError(
            f"{folder} exists already; choose another name or remove it", path=str(folder)
        )
    dataset = recorder.dataset
    names = tuple(sequences or [name for name in dataset.sequences if len(dataset.sequence(name))])
    if every < 1 or not names:
        raise CorrectionError(
            f"every = {every} of {len(names)} sequences with clouds; expected at least one",
            key="every",
        )
    for name in names:
        if not len(dataset.sequence(name)):
            raise CorrectionError(
                f"{name} has no clouds to learn from; leave it out", key="sequences", value=name
            )
    folder.parent.mkdir(parents=True, exist_ok=True)
    aside = Path(tempfile.mkdtemp(prefix=f".{folder.name}-", dir=folder.parent))
    try:
        made = dict(_all(recorder, aside, names, every, workers, report))
        _write_about(aside, dataset, recorder, [made[name] for name in names], every)
        aside.chmod(0o755)
        _take_place(aside, folder)
    except BaseException:
        shutil.rmtree(aside, ignore_errors=True)
        raise
    report(1.0, f"{sum(one.count for one in made.values())} samples")
    return open_samples(folder)


def _take_place(aside: Path, folder: Path) -> None:
    try:
        aside.rename(folder)
    except OSError as error:
        if folder.exists():
            raise RunError(
                f"{folder} was made by another in the meantime", path=str(folder)
            ) from error
        raise


@dataclass(frozen=True, eq=False)
class _Made:
    """Of one sequence: samples, frames left out, and measured points near each material point
    (v,)."""

    name: str
    count: int
    left_out: int
    seen: FloatArray


def _all(
    recorder: Recorder, folder: Path, names: Sequence[str], every: int, workers: int, report: Report
) -> Iterable[tuple[str, _Made]]:
    if workers <= 1:
        for number, name in enumerate(names):
            told = part(report, number / len(names), (number + 1) / len(names))
            yield name, _sample(recorder, folder, name, every, told)
        return
    with ProcessPool(min(workers, len(names)), start="forkserver") as pool:
        futures = [pool.submit(_sample, recorder.only(name), folder, name, every) for name in names]
        try:
            for done, future in enumerate(as_completed(futures)):
                found = future.result()
                report((done + 1) / len(names), f"replayed {found.name}")
                yield found.name, found
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _sample(
    recorder: Recorder, folder: Path, name: str, every: int, report: Report = silent
) -> _Made:
    """Write one sequence's arrays, a frame at a time."""
    sequence = recorder.dataset.sequence(name)
    chosen = np.arange(0, len(sequence), every)
    stamps = np.asarray(sequence.cloud_times)[chosen]
    times, robot = stamps - recorder.setup.sensor.time_offset, recorder.phantom_from_robot
    centres = robot.apply(smooth_centres(sequence.kinematics, times))
    poses = tool_poses(
        sequence.kinematics, stamps, recorder.setup.phantom_from_robot, recorder.shaft
    )
    tool, sight = tool_columns(sequence, times, robot, recorder.measured), sight_of(recorder.setup)
    touched = distance_to_block(recorder.setup.box.size, centres) <= recorder.setup.tool.radius + CLEARANCE
    probes = np.where(touched, np.cumsum(np.diff(touched.astype(int), prepend=0) > 0), 0)
    (folder / name).mkdir()
    files = SampleWriter(folder / name, len(chosen), len(recorder.body.rest), recorder.points)
    seen, row = np.zeros(len(recorder.body.rest)), 0
    block, previous = Replay(recorder.setup, recorder.grid, TOLERANCE), None
    for number, frame in enumerate(chosen):
        report(number / len(chosen), f"{name}: frame {number + 1} of {len(chosen)}")
        found = block.solve_from_any(centres[number], (previous,), float(times[number]))
        previous = (
            found
            if found.outcome is Outcome.CONVERGED
            else previous
            if recorder.setup.has_history
            else None
        )
        cloud = sequence.cloud(int(frame))
        cloud = cloud[recorder.cleaner.clean(cloud, poses[number]).indices]
        if found.outcome is not Outcome.CONVERGED or len(cloud) < _LEAST_POINTS:
            continue
        rng = np.random.default_rng([recorder.seed, number, *name.encode()])
        points, upper, near = _measured(recorder, sight, found, cloud, rng)
        seen += near
        if not recorder.measured:
            tool[number, 10:] = found.force
        files.put(
            row,
            positions=found.move(recorder.body.rest),
            tool=tool[number],
            points=points,
            count=(upper, len(points)),
            time=stamps[number],
            frame=frame,
            probe=probes[number],
        )
        row += 1
    files.close(row)
    return _Made(name, row, len(chosen) - row, seen)


_LEAST_POINTS = 20


def _measured(
    recorder: Recorder,
    sight: Sight,
    frame: Equilibrium,
    cloud: FloatArray,
    rng: np.random.Generator,
) -> tuple[FloatArray, int, FloatArray]:
    """Points (n, 3) [m] of a cleaned cloud, phantom frame, those of the top first; their number;
    points near each vertex (v,).
    """
    if len(cloud) > recorder.points:
        cloud = cloud[np.sort(rng.choice(len(cloud), recorder.points, replace=False))]
    points, body = sight.place(cloud), recorder.body
    _, nearest = cKDTree(body.surface(frame.move(body.rest))).query(points)
    height = body.rest[:, 2].max()
    upper = body.surface(body.rest)[nearest, 2] >= height * (1 - 1e-6)
    near = np.zeros(len(body.rest))
    np.add.at(near, body.corners[nearest], body.shares[nearest])
    return points[np.argsort(~upper, kind="stable")], int(upper.sum()), near


def canonical_quaternions(quaternions: FloatArray) -> FloatArray:
    """The same rotations (n, 4) with their largest component positive: q and -q are one rotation,
    and a network sees numbers.
    """
    largest = np.take_along_axis(quaternions, np.abs(quaternions).argmax(axis=1)[:, None], axis=1)
    return np.asarray(quaternions * np.sign(largest))


def tool_columns(
    sequence: Recording, times: FloatArray, phantom_from_robot: Transform, measured: bool
) -> FloatArray:
    """What is known of the tool at times (n,) [s]: (n, 13), see
    `palpate.correction.samples.sample_store`; without a sensor the force is zero.
    """
    path = sequence.kinematics
    rows = np.clip(np.searchsorted(path.time, times), 0, len(path.time) - 1)
    turned = Rotation.from_matrix(phantom_from_robot.rotation) * Rotation.from_quat(
        path.quaternion[rows]
    )
    ahead, behind = (smooth_centres(path, times + step) for step in (SMOOTHING, -SMOOTHING))
    force = np.zeros((len(times), 3))
    if measured and sequence.forces is not None:
        force = phantom_from_robot.rotate(
            averaged(sequence.forces.time, sequence.forces.force, times)
        )
    centres = phantom_from_robot.apply(smooth_centres(path, times))
    velocity = phantom_from_robot.rotate(ahead - behind) / (2 * SMOOTHING)
    return np.concatenate(
        [centres, canonical_quaternions(turned.as_quat()), velocity, force], axis=1
    )


def _write_about(
    folder: Path, dataset: Dataset, recorder: Recorder, made: Sequence[_Made], every: int
) -> None:
    total = sum(one.count for one in made)
    if not total:
        raise CorrectionError(
            "no frame of these sequences is of use: none has both an equilibrium and points",
            key="sequences",
        )
    config, here = dataset.config, {one.name for one in made}
    splits = {"train": config.train, "validation": config.validation, "test": config.test}
    about = {
        "format": FORMAT,
        "dataset": config.name,
        "sequences": {one.name: one.count for one in made},
        "left_out": {one.name: one.left_out for one in made},
        "splits": {
            split: [name for name in names if name in here] for split, names in splits.items()
        },
        "grid": None if recorder.body.grid is None else list(recorder.body.grid),
        "points": recorder.points,
        "every": every,
        "force": "measured" if recorder.measured else "simulated",
        "mesh": stored_label(recorder.grid),
        "seed": recorder.seed,
        "setup": recorder.setup.as_dict(),
        "seen": (np.sum([one.seen for one in made], axis=0) / total).tolist(),
    }
    arrays = {
        name: value
        for name, value in recorder.body.to_arrays().items()
        if name not in ("grid", "flat")
    }
    np.savez(folder / "body.npz", **arrays)
    (folder / "samples.json").write_text(json.dumps(about, indent=1))
