"""What the points of a sweep are compared with: the cleaned clouds of chosen frames, read once."""

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
from palpate.measurement.phantom_drift import as_it_stood
from palpate.measurement.segmentation import cleaner_for, find_shaft_axis, tool_poses
from palpate.registration.registration import register, setup_from
from palpate.setup.box import CLEARANCE, distance_to_block
from palpate.setup.setup import Setup

__all__ = ["SweepSequence", "read_sweep_data"]

_MOST_POINTS = 6000


@dataclass(frozen=True, eq=False)
class SweepSequence:
    """Chosen frames of one sequence, in the order of time.

    Attributes:
        times: (f,) cloud stamps [s].
        clouds: of each frame the cleaned points (n, 3) [m], camera frame.
        probes: (f,) which push of the sequence each belongs to.
    """

    name: str
    kinematics: Kinematics
    times: FloatArray
    clouds: tuple[FloatArray, ...]
    probes: FloatArray

    @property
    def digest(self) -> str:
        """Of everything that a replay and its error take from here; the name is not among it."""
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
    """The stated setup with its registrations, and the touched frames of these sequences, at most
    `frames` of each.

    Of no name all sequences with clouds are taken. DatasetError where a sequence has none, or none
    in which the tool touches.
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
    report(0.0, "relating robot, camera and phantom")
    dataset, registration = as_it_stood(dataset, register(dataset))
    setup = setup_from(dataset, registration)
    cleaner, shaft = cleaner_for(dataset, registration), find_shaft_axis(dataset, registration)
    found = []
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
            clouds.append(_thinned(raw[cleaner.clean(raw, pose).indices]))
        found.append(
            SweepSequence(
                name,
                sequence.kinematics,
                times[chosen],
                tuple(clouds),
                probes[chosen].astype(float),
            )
        )
    return setup, tuple(found)


def _thinned(points: FloatArray) -> FloatArray:
    """At most so many points, always the same ones."""
    if len(points) <= _MOST_POINTS:
        return points
    return points[
        np.sort(np.random.default_rng(0).choice(len(points), _MOST_POINTS, replace=False))
    ]
