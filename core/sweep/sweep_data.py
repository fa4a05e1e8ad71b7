"""The data of a sweep: segmented clouds of selected frames, read once."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.dataset import Dataset, Kinematics
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.experiment import Experiment, sequences_with_clouds
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.metrics import paper_distance
from palpate.measurement.patch_averages import patch_means
from palpate.measurement.surface_gaps import gaps
from palpate.mesh.protocol import Meshing
from palpate.replay.replay import rest
from palpate.setup.phantom_geometry import CLEARANCE
from palpate.setup.setup import Setup
from palpate.sweep.frame_choice import informative_frames
from palpate.sweep.parameter_space import ParameterSpace

__all__ = ["SweepData", "SweepSequence", "read_sweep_data"]

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


@dataclass(frozen=True, eq=False)
class SweepData:
    """The clouds that a sweep compares its replays with.

    Attributes:
        stated: the stated setup with its registrations.
        sequences: frames in which the tool touches.
        rest: the phantom's points (n, 3) [m] in the rest cloud, camera frame.
    """

    stated: Setup
    sequences: tuple[SweepSequence, ...]
    rest: FloatArray

    def rest_error(self, grid: Meshing, measure: str) -> float:
        """Error of the untouched phantom [m]: of sensor and registration, which no push explains.

        `measure` as of `palpate.sweep.sweep_error.error_from_sums`.
        """
        surface, sight = self.stated.surface(), camera_model_for(self.stated, reference=True)
        points, frame = sight.place(self.rest), rest(self.stated, grid)
        if measure == "paper":
            return float(paper_distance(points[::2], frame, surface))
        met = gaps(points, sight.pose.translation, frame, surface)
        means = patch_means(met.gap, met.patch, surface.patches)
        known = np.isfinite(means.mean)
        return float(np.sqrt(np.average(means.mean[known] ** 2, weights=means.count[known])))


def read_sweep_data(
    dataset: Dataset,
    names: Sequence[str],
    frames: int,
    report: Report = silent,
    space: ParameterSpace | None = None,
) -> SweepData:
    """Register a dataset and read the frames of a sweep.

    Args:
        dataset: the dataset.
        names: sequences to use; all with clouds if empty.
        frames: most frames of each sequence, those that press deepest and differ most.
        report: receives the progress.
        space: what will be swept; points on any of its tools are removed from the clouds, so that
            all setups are compared with the same points.

    Raises DatasetError where a sequence has no clouds, or none in which the tool touches.
    """
    names = sequences_with_clouds(dataset, names)
    report(0.0, "registering robot, camera and phantom")
    experiment = Experiment.of(dataset)
    setup = experiment.stated
    radii = space.tool_radii(setup) if space else []
    sequences = []
    for number, name in enumerate(names):
        report((number + 1) / (len(names) + 1), f"reading {name}")
        sequence = experiment.dataset.sequence(name)
        times = np.asarray(sequence.cloud_times)
        centres = setup.phantom_from_robot.apply(smooth_centres(sequence.kinematics, times))
        depth = setup.tool.radius - setup.geometry.distance(centres)
        touched = depth >= -CLEARANCE
        probes = np.cumsum(np.diff(touched.astype(int), prepend=0) > 0)
        if not touched.any():
            raise DatasetError(
                f"{name}: the tool touches the phantom in no cloud; choose other sequences",
                file=f"sequences/{name}",
            )
        chosen = informative_frames(centres, depth, touched, frames)
        observed = experiment.observe(name, chosen, keep=_subsampled, radii=radii)
        sequences.append(
            SweepSequence(
                name,
                sequence.kinematics,
                observed.times,
                observed.clouds,
                probes[chosen].astype(float),
            )
        )
    raw = dataset.rest_cloud()
    untouched = raw[experiment.cleaner.clean(raw).indices]
    return SweepData(setup, tuple(sequences), _subsampled(untouched))


def _subsampled(points: FloatArray) -> FloatArray:
    """Return at most _MOST_POINTS points, drawn with a fixed seed."""
    if len(points) <= _MOST_POINTS:
        return points
    return points[
        np.sort(np.random.default_rng(0).choice(len(points), _MOST_POINTS, replace=False))
    ]
