"""The data of a sweep: segmented clouds of selected frames, read once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Dataset, Kinematics
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.measurement.phantom_drift import align_sequences
from palpate.measurement.segmentation import cleaner_for
from palpate.measurement.tool_pose import find_shaft_axis, tool_poses
from palpate.registration.registration import register, setup_from
from palpate.setup.box import CLEARANCE, distance_to_block
from palpate.setup.setup import Setup

__all__ = ["SweepSequence", "read_sweep_data"]

_MOST_POINTS = 6000
"""Points kept of a cloud."""


@dataclass(frozen=True, eq=False)
class SweepSequence:
    """Selected frames of one sequence, in the order of time.

    Attributes:
        name: name of the sequence.
        kinematics: recorded motion of the tool, robot frame.
        times: (f,) cloud stamps [s].
        clouds: segmented points (n, 3) [m] of each frame, camera frame.
        probes: (f,) number of the push that each frame belongs to.
    """

    name: str
    kinematics: Kinematics
    times: FloatArray
    clouds: tuple[FloatArray, ...]
    probes: FloatArray

    @property
    def digest(self) -> str:
        """Digest of all data that a replay and its error depend on; the name is not included."""
        digest = hashlib.sha256()
        for array in (
            self.kinematics.time,
            self.kinematics.position,
            self.times,
            self.probes,
            *self.clouds,
        ):
            digest.update(str(array.shape).encode() + np.ascontiguousarray(array).tobytes())
        return digest.hexdigest()


def read_sweep_data(
    dataset: Dataset, names: Sequence[str], frames: int, report: Report = silent
) -> tuple[Setup, tuple[SweepSequence, ...]]:
    """Return the stated setup with its registrations, and frames in which the tool touches.

    Args:
        dataset: the dataset.
        names: sequences to use; all with clouds if empty.
        frames: most frames of each sequence, evenly spread.
        report: receives the progress.

    Raises DatasetError where a sequence has no clouds, or none in which the tool touches.
    """
    names = tuple(dict.fromkeys(names)) or tuple(
        name for name in dataset.sequences if len(dataset.sequence(name))
    )
    if not names:
        raise DatasetError(
            "no sequence has clouds, and a sweep compares with clouds; record some", key="sequences"
        )
    for name in names:
        if not len(dataset.sequence(name)):
            raise DatasetError(
                f"{name} has no clouds to compare with; choose other sequences",
                file=f"sequences/{name}",
                key="sequences",
            )
    report(0.0, "registering robot, camera and phantom")
    dataset, registration = align_sequences(dataset, register(dataset))
    setup = setup_from(dataset, registration)
    cleaner, shaft = cleaner_for(dataset, registration), find_shaft_axis(dataset, registration)
    sequences = []
    for number, name in enumerate(names):
        report((number + 1) / (len(names) + 1), f"reading {name}")
        sequence = dataset.sequence(name)
        times = np.asarray(sequence.cloud_times)
        centres = setup.phantom_from_robot.apply(smooth_centres(sequence.kinematics, times))
        touched = distance_to_block(setup.box.size, centres) <= setup.tool.radius + CLEARANCE
        probes = np.cumsum(np.diff(touched.astype(int), prepend=0) > 0)
        near = np.flatnonzero(touched)
        if not len(near):
            raise DatasetError(
                f"{name}: the tool touches the phantom in no cloud; choose other sequences",
                file=f"sequences/{name}",
            )
        chosen = near[
            np.unique(np.linspace(0, len(near) - 1, min(len(near), frames)).round().astype(int))
        ]
        poses = tool_poses(sequence.kinematics, times[chosen], setup.phantom_from_robot, shaft)
        clouds = []
        for frame, pose in zip(chosen, poses, strict=True):
            raw = sequence.cloud(int(frame))
            clouds.append(_subsampled(raw[cleaner.clean(raw, pose).indices]))
        sequences.append(
            SweepSequence(
                name,
                sequence.kinematics,
                times[chosen],
                tuple(clouds),
                probes[chosen].astype(float),
            )
        )
    return setup, tuple(sequences)


def _subsampled(points: FloatArray) -> FloatArray:
    """Return at most _MOST_POINTS points, drawn with a fixed seed."""
    if len(points) <= _MOST_POINTS:
        return points
    return points[
        np.sort(np.random.default_rng(0).choice(len(points), _MOST_POINTS, replace=False))
    ]
