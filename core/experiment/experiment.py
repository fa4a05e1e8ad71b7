"""One measured experiment: a dataset whose robot, camera and phantom are related, with its model.

Everything that compares a simulation with measurements starts here: diagnosis, sweeps, correction,
evaluation, the page and a user's own script. The steps are always the same: register, align each
sequence with where the phantom stood when it began, state the setup, and prepare the segmentation
of the clouds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np

from palpate.consistency import check_consistency
from palpate.dataset import Dataset, Sequence, open_dataset
from palpate.dataset.accepted_registration import AcceptedRegistration
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.effects import Effect
from palpate.effects.base import with_effects
from palpate.experiment.observed_clouds import ObservedClouds, segment_clouds
from palpate.experiment.replayed_sequence import ReplayedSequence
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.measurement.phantom_drift import align_sequences
from palpate.measurement.segmentation import Cleaner, cleaner_for
from palpate.measurement.tool_pose import ToolShaft, find_shaft
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.default_meshes import Use, motion_mesh
from palpate.mesh.protocol import Meshing
from palpate.registration.registration import Registration, setup_from
from palpate.registration.registration import register as relate_frames
from palpate.replay.replay import replay
from palpate.setup.setup import Sensor, Setup

__all__ = ["Experiment", "register", "sequences_with_clouds"]

_RATE = 30.0
"""Frames a second of a replay without clouds [1/s]."""


@dataclass(frozen=True, eq=False)
class Experiment:
    """A registered dataset and what is believed of it. Make one with `Experiment.of(dataset)`.

    Attributes:
        dataset: the sequences, each aligned with where the phantom stood when it began.
        registration: how robot, camera and phantom relate, with uncertainties and warnings.
        setup: the model that `replay` solves: as stated, plus the effects of `with_effects`.
        effects: the effects in `setup` beyond what is stated.
    """

    dataset: Dataset
    registration: Registration
    setup: Setup
    effects: tuple[Effect, ...] = ()

    @classmethod
    def of(
        cls,
        dataset: Dataset | Path | str,
        *,
        accepted: AcceptedRegistration | None = None,
        report: Report = silent,
    ) -> Self:
        """Relate robot, camera and phantom of a dataset.

        Args:
            dataset: as opened, or the path of its folder.
            accepted: a camera registration made by hand, used in place of the automatic one.
            report: progress.

        Raises RegistrationError where the frames cannot be related, DatasetError for a dataset
        that is off.
        """
        opened = dataset if isinstance(dataset, Dataset) else open_dataset(Path(dataset))
        if accepted is not None:
            opened = opened.registered(accepted)
        return cls.registered(opened, relate_frames(opened, report))

    @classmethod
    def registered(cls, dataset: Dataset, registration: Registration) -> Self:
        """The experiment of a dataset whose registration is known already."""
        contradictions = check_consistency(dataset, registration)
        aligned, registration = align_sequences(dataset, registration)
        warnings = (*registration.warnings, *contradictions)
        registration = replace(registration, warnings=warnings)
        return cls(aligned, registration, setup_from(aligned, registration))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Doubts about the registration, one sentence each."""
        return self.registration.warnings

    @property
    def sequences(self) -> tuple[str, ...]:
        """Names of the sequences that have clouds."""
        return sequences_with_clouds(self.dataset)

    @cached_property
    def stated(self) -> Setup:
        """The setup as the dataset states it, without effects."""
        return setup_from(self.dataset, self.registration)

    @cached_property
    def cleaner(self) -> Cleaner:
        """Segmentation of the phantom in the raw clouds, for the stated and the model's tool."""
        return cleaner_for(self.dataset, self.registration).allowing(self.setup.tool.radius)

    @cached_property
    def shaft(self) -> ToolShaft | None:
        """The tool's shaft in the tool's frame; None where no cloud shows one."""
        return find_shaft(self.dataset, self.registration.repaired)

    def observation_setup(self, sensor: Sensor) -> Setup:
        """The stated setup as observations need it.

        The robot is where the repaired touches put it, since the tool has to be found in the
        clouds; `sensor` gives the clock.
        """
        return replace(setup_from(self.dataset, self.registration.repaired), sensor=sensor)

    def with_effects(self, *effects: Effect) -> Self:
        """The same experiment with these effects added to its model.

        Raises EffectError where an effect does not fit the setup.
        """
        return replace(
            self, setup=with_effects(self.setup, effects), effects=(*self.effects, *effects)
        )

    def grid(self, centres: FloatArray) -> Meshing:
        """The mesh of a replay of tool centres (f, 3) [m], phantom frame."""
        stated = self.setup.stated_geometry
        return motion_mesh(Use.REPLAY, stated, self.setup.tool.radius, centres)

    def mesh(self, use: Use, sequences: Iterable[str]) -> Meshing:
        """The mesh of a use for replays of sequences, of which there is at least one."""
        streams = [self.dataset.sequence(name).kinematics for name in sequences]
        places = [one.position_at(_thinned(np.asarray(one.time))) for one in streams]
        centres = self.stated.phantom_from_robot.apply(np.concatenate(places))
        return motion_mesh(use, self.stated.geometry, self.stated.tool.radius, centres)

    def observe(
        self,
        sequence: str,
        frames: IntArray | None = None,
        report: Report = silent,
        keep: Callable[[FloatArray], FloatArray] = np.asarray,
        radii: Iterable[float] = (),
    ) -> ObservedClouds:
        """The phantom's points in the clouds of a sequence.

        Args:
            sequence: name.
            frames: indices of the clouds; all of them where none is given.
            report: progress.
            keep: applied to the points (n, 3) [m] of each cloud, camera frame, e.g. to thin them.
            radii: of tools [m] of other models that will be compared with the same points.
        """
        recorded = self.dataset.sequence(sequence)
        chosen = np.arange(len(recorded)) if frames is None else np.asarray(frames, dtype=int)
        cleaner = self.cleaner.allowing(*radii)
        return segment_clouds(
            recorded, chosen, cleaner, self.stated.phantom_from_robot, self.shaft, report, keep
        )

    def centres(self, sequence: Sequence, times: FloatArray, grid: Meshing) -> FloatArray:
        """Tool centres (f, 3) [m] under the model at cloud stamps (f,) [s], phantom frame."""
        robot = touch_correction(self.setup, grid) @ self.setup.phantom_from_robot
        clock = times - self.setup.sensor.time_offset
        return robot.apply(smooth_centres(sequence.kinematics, clock))

    def replay(
        self,
        sequence: str,
        *,
        every: int = 1,
        grid: Meshing | None = None,
        tolerance: float = 1e-3,
        report: Report = silent,
    ) -> ReplayedSequence:
        """Simulate one sequence: one equilibrium per cloud, or thirty a second without clouds.

        Args:
            sequence: name.
            every: every how many frames one is solved.
            grid: the mesh; graded around the tool where none is given.
            tolerance: residual over the push at which a frame counts as converged [1].
            report: progress.

        A frame without equilibrium is kept with its outcome: look at `ReplayedSequence.failed`.
        """
        recorded = self.dataset.sequence(sequence)
        stamps = np.asarray(recorded.cloud_times)
        observed = len(stamps) > 0
        if not observed:
            stamps = _thinned(np.asarray(recorded.kinematics.time))
        index = np.arange(0, len(stamps), every)
        times = stamps[index]
        rough = self.stated.phantom_from_robot.apply(recorded.kinematics.position_at(times))
        mesh = grid or self.grid(rough)
        centres = self.centres(recorded, times, mesh)
        clock = times - self.setup.sensor.time_offset
        frames = replay(self.setup, centres, mesh, times=clock, tolerance=tolerance, report=report)
        return ReplayedSequence(
            self, sequence, times, index if observed else None, centres, tuple(frames)
        )


def sequences_with_clouds(dataset: Dataset, names: Iterable[str] = ()) -> tuple[str, ...]:
    """The named sequences without repeats, or all that have clouds where none is named.

    Raises DatasetError where a named sequence has no clouds, or no sequence of the dataset has.
    """
    chosen = tuple(dict.fromkeys(names)) or tuple(
        name for name in dataset.sequences if len(dataset.sequence(name))
    )
    if not chosen:
        raise DatasetError(
            "no sequence has clouds to compare a simulation with; record some", key="sequences"
        )
    for name in chosen:
        if not len(dataset.sequence(name)):
            raise DatasetError(
                f"{name} has no clouds to compare with; choose other sequences",
                file=f"sequences/{name}",
                key="sequences",
            )
    return chosen


def _thinned(times: FloatArray) -> FloatArray:
    """Stamps (n,) [s] of a robot stream at no more than `_RATE` a second."""
    slots = np.floor((times - times[0]) * _RATE)
    return times[np.unique(slots, return_index=True)[1]]


def register(
    dataset: Dataset | Path | str,
    *,
    accepted: AcceptedRegistration | None = None,
    report: Report = silent,
) -> Experiment:
    """Relate robot, camera and phantom of a dataset; see `Experiment.of`."""
    return Experiment.of(dataset, accepted=accepted, report=report)
