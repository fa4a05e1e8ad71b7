"""Recording of samples: a model is replayed along the recorded motion, beside the clouds."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from palpate.correction.samples.sample_arrays import SampleWriter
from palpate.correction.samples.sample_recorder import Recorder, measured_points
from palpate.correction.samples.sample_store import FORMAT, Samples, open_samples, save_bodies
from palpate.correction.samples.tool_columns import tool_columns
from palpate.dataset import Dataset
from palpate.dataset.provenance import made_from
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import CorrectionError, RunError
from palpate.foundation.processes import ProcessPool
from palpate.foundation.progress import Report, part, silent
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.tool_pose import tool_poses
from palpate.mesh.stored_label import stored_label
from palpate.replay.replay import Replay
from palpate.setup.phantom_geometry import CLEARANCE
from palpate.setup.setup import Setup

__all__ = ["make_samples"]

TOLERANCE = 1e-3
"""Residual over the push force at which a frame counts as converged [1]; equal to the page's."""
_FEWEST_POINTS = 20
"""Measured points that a sample needs."""


def make_samples(
    folder: Path,
    recorder: Recorder,
    *,
    sequences: Sequence[str] | None = None,
    every: int = 1,
    workers: int = 1,
    report: Report = silent,
) -> Samples:
    """Replay sequences and write their samples to `folder` atomically.

    Frames without equilibrium or with fewer than 20 points are left out; samples.json has their
    number.

    Args:
        folder: folder of the samples; RunError if it exists, now or when the samples are made.
        recorder: the model and the settings.
        sequences: names of the sequences; all with clouds if None.
        every: interval between the clouds that are used.
        workers: number of processes.
        report: receives the progress.

    Raises CorrectionError for sequences without clouds.
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
        made = dict(_record_all(recorder, aside, names, every, workers, report))
        _write_about(aside, dataset, recorder, [made[name] for name in names], every)
        aside.chmod(0o755)
        _rename(aside, folder)
    except BaseException:
        shutil.rmtree(aside, ignore_errors=True)
        raise
    report(1.0, f"{sum(one.count for one in made.values())} samples")
    return open_samples(folder)


def _rename(aside: Path, folder: Path) -> None:
    try:
        aside.rename(folder)
    except OSError as error:
        if folder.exists():
            raise RunError(
                f"{folder} was made by another process in the meantime", path=str(folder)
            ) from error
        raise


@dataclass(frozen=True, eq=False)
class _Recorded:
    """The samples of one sequence.

    Attributes:
        name: name of the sequence.
        count: number of samples.
        left_out: number of frames that were left out.
        seen: (r,) measured points near each material point.
    """

    name: str
    count: int
    left_out: int
    seen: FloatArray


def _record_all(
    recorder: Recorder, folder: Path, names: Sequence[str], every: int, workers: int, report: Report
) -> Iterable[tuple[str, _Recorded]]:
    if workers <= 1:
        for number, name in enumerate(names):
            progress = part(report, number / len(names), (number + 1) / len(names))
            yield name, _record(recorder, folder, name, every, progress)
        return
    with ProcessPool(min(workers, len(names)), start="forkserver") as pool:
        futures = [pool.submit(_record, recorder.only(name), folder, name, every) for name in names]
        try:
            for done, future in enumerate(as_completed(futures)):
                recorded = future.result()
                report((done + 1) / len(names), f"replayed {recorded.name}")
                yield recorded.name, recorded
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise


def _record(
    recorder: Recorder, folder: Path, name: str, every: int, report: Report = silent
) -> _Recorded:
    """Replay one sequence and write its arrays frame by frame."""
    sequence, setup = recorder.dataset.sequence(name), recorder.setup
    chosen = np.arange(0, len(sequence), every)
    stamps = np.asarray(sequence.cloud_times)[chosen]
    times, robot = stamps - setup.sensor.time_offset, recorder.phantom_from_robot
    centres = robot.apply(smooth_centres(sequence.kinematics, times))
    poses = tool_poses(sequence.kinematics, stamps, setup.phantom_from_robot, recorder.shaft)
    tool = tool_columns(sequence, times, robot, recorder.measured)
    camera, probes = camera_model_for(setup), _push_numbers(setup, centres)
    (folder / name).mkdir()
    writer = SampleWriter(folder / name, len(chosen), len(recorder.rest), recorder.points)
    seen, row = np.zeros(len(recorder.body.rest)), 0
    block, previous = Replay(setup, recorder.grid, TOLERANCE), None
    for number, index in enumerate(chosen):
        report(number / len(chosen), f"{name}: frame {number + 1} of {len(chosen)}")
        frame = block.solve_from_any(centres[number], (previous,), float(times[number]))
        solved = frame.outcome is Outcome.CONVERGED
        previous = frame if solved else previous if setup.has_history else None
        cloud = sequence.cloud(int(index))
        cloud = cloud[recorder.cleaner.clean(cloud, poses[number]).indices]
        if not solved or len(cloud) < _FEWEST_POINTS:
            continue
        rng = np.random.default_rng([recorder.seed, number, *name.encode()])
        points, upper, near = measured_points(recorder, camera, frame, cloud, rng)
        seen += near
        if not recorder.measured:
            tool[number, 10:] = frame.force
        writer.put(
            row,
            positions=frame.move(recorder.rest),
            tool=tool[number],
            points=points,
            count=(upper, len(points)),
            time=stamps[number],
            frame=index,
            probe=probes[number],
        )
        row += 1
    writer.close(row)
    return _Recorded(name, row, len(chosen) - row, recorder.seen(seen))


def _push_numbers(setup: Setup, centres: FloatArray) -> FloatArray:
    """Return the number of the push at each tool centre (f, 3) [m], from 1; 0 where it is clear."""
    reach = setup.tool.radius + CLEARANCE
    touched = setup.geometry.distance(centres) <= reach
    return np.where(touched, np.cumsum(np.diff(touched.astype(int), prepend=0) > 0), 0)


def _write_about(
    folder: Path, dataset: Dataset, recorder: Recorder, made: Sequence[_Recorded], every: int
) -> None:
    """Write samples.json and body.npz."""
    total = sum(one.count for one in made)
    if not total:
        raise CorrectionError(
            "no frame of these sequences has both an equilibrium and points", key="sequences"
        )
    config, here = dataset.config, {one.name for one in made}
    splits = {"train": config.train, "validation": config.validation, "test": config.test}
    about = {
        "format": FORMAT,
        "dataset": config.name,
        "made_from": made_from(dataset.path),
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
    save_bodies(folder, recorder.body, recorder.chart)
    (folder / "samples.json").write_text(json.dumps(about, indent=1))
