"""One frame of a recorded sequence, solved again with chosen causes."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from palpate.dataset import open_dataset
from palpate.dataset.accepted_registration import AcceptedRegistration
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.effects import DIAGNOSED, Effect
from palpate.effects.base import with_effects
from palpate.experiment import Experiment
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RunError
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.default_meshes import Use
from palpate.recording.interactive import InteractiveReplay
from palpate.recording.interior_fields import InteriorFields
from palpate.recording.record_sequence import ModelRecording, compare_with_clouds
from palpate.recording.saved_model import setup_of_model, with_fitted_values
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import replay
from palpate.setup.setup import Setup

__all__ = ["FrameResolver", "ResolvedFrame", "open_resolver"]

_TOLERANCE = 1e-3
"""Relative residual at which a frame counts as converged; that of the recording."""
_SAMPLES = 50
"""Points of an axis that are looked at, for each of those that state it."""


@dataclass(frozen=True, eq=False)
class ResolvedFrame:
    """One frame with chosen causes, phantom frame, SI.

    Attributes:
        surface: (v, 3) moved material vertices, in the order of the recording [m].
        error: (v,) mean gap of the measured points around each [m]; NaN if unseen.
        distance: RMS of `error` [m].
        tool: (3,) true centre [m].
        radius: of the tool [m].
        outcome: how the solve ended.
        converged: whether this is an equilibrium.
        camera: (4, 4) phantom_from_camera.
        inside: interior fields as of a recording of one frame.
        notes: doubts about the causes, one sentence each.
    """

    surface: FloatArray
    error: FloatArray
    distance: float
    tool: FloatArray
    radius: float
    outcome: str
    converged: bool
    camera: FloatArray
    inside: InteriorFields
    notes: tuple[str, ...] = ()


class FrameResolver:
    """A recorded sequence whose frames can be solved again.

    Args:
        folder: of the dataset.
        sequence: name.
        clouds: (f,) numbers of the clouds of the recording.
        extended: the model as in model.json, which has the fitted registration.
    """

    def __init__(
        self, folder: Path, sequence: str, clouds: Sequence[int], extended: dict[str, Any]
    ) -> None:
        self._experiment = _experiment(folder, json.dumps(extended.get("registration")))
        if not len(self._experiment.dataset.sequence(sequence)):
            raise RunError(
                f"{sequence} has no clouds, so that there is nothing to compare with",
                sequence=sequence,
            )
        self.stated = self._experiment.stated
        self.tuned = with_fitted_values(self.stated, extended)
        self._recorded_radius = setup_of_model(self.stated, extended).tool.radius
        self._sequence = self._experiment.dataset.sequence(sequence)
        self._clouds = np.asarray(clouds, dtype=int)
        self._times = np.asarray(self._sequence.cloud_times)[self._clouds]
        self._grid = self._experiment.mesh(Use.PAGE, [sequence])
        self._cleaned: dict[tuple[int, float], FloatArray] = {}
        self._last: tuple[int, Equilibrium] | None = None

    def __len__(self) -> int:
        return len(self._clouds)

    def beginnings(self) -> list[dict[str, Any]]:
        """One finite size of each effect of the catalogue, to start from by hand."""
        result = []
        for effect in DIAGNOSED:
            if not effect.impossible(self.stated) and (starts := effect.starts(self.stated)):
                result.append(starts[len(starts) // 2].to_json())
        return result

    def impossible(self) -> dict[str, str]:
        """Names of the effects that this setup cannot have, each with the reason as a clause."""
        reasons = {effect.name: effect.impossible(self.stated) for effect in DIAGNOSED}
        return {name: reason for name, reason in reasons.items() if reason}

    def spans(self) -> dict[str, dict[str, tuple[float, float]]]:
        """Lowest and highest value [SI] of numbers that this body limits, by effect and name."""
        body = self.stated.geometry
        return {effect.name: found for effect in DIAGNOSED if (found := effect.spans(body))}

    def setup(self, effects: Sequence[Effect], tuned: bool = True) -> Setup:
        """The stated setup with these causes; `tuned` as in `solve`."""
        return with_effects(self.tuned if tuned else self.stated, effects)

    def live(self, effects: Sequence[Effect], tuned: bool = True) -> InteractiveReplay:
        """The same block as an interactive replay."""
        return InteractiveReplay(self.setup(effects, tuned), self._grid)

    def solve(self, frame: int, effects: Sequence[Effect], tuned: bool = True) -> ResolvedFrame:
        """Solve a frame with these causes added to the stated setup.

        If a frame depends on those before it (material history, friction at the tool), all up to it
        are solved. Raises RunError for a frame that does not exist, EffectError for parameters out
        of bounds.

        Args:
            frame: index into the recording.
            effects: the causes.
            tuned: robot pose, tool radius and Poisson's ratio as the diagnosis fitted them within
                their accuracies, instead of as stated.
        """
        if not 0 <= frame < len(self):
            raise RunError(
                f"there is no frame {frame}; the recording has 0 to {len(self) - 1}", frame=frame
            )
        setup = self.setup(effects, tuned)
        solved = self._solved(setup, frame)
        side: ModelRecording = compare_with_clouds(setup, [solved], [self._cloud(frame, setup)])
        return ResolvedFrame(
            side.surface[0],
            side.error[0],
            float(side.distance[0]),
            side.tool[0],
            setup.tool.radius,
            solved.outcome.value,
            not side.outcome[0],
            np.asarray(camera_model_for(setup).pose.matrix),
            side.inside,
            tuple(_outside(setup)),
        )

    def _solved(self, setup: Setup, frame: int) -> Equilibrium:
        robot = touch_correction(setup, self._grid) @ setup.phantom_from_robot
        picked = slice(0, frame + 1) if setup.has_history else slice(frame, frame + 1)
        times = self._times[picked] - setup.sensor.time_offset
        centres = robot.apply(smooth_centres(self._sequence.kinematics, times))
        warm = (
            None
            if setup.has_history or self._last is None or self._last[0] != frame
            else [self._last[1]]
        )
        result = replay(setup, centres, self._grid, times=times, starts=warm, tolerance=_TOLERANCE)[
            -1
        ]
        self._last = (frame, result)
        return result

    def _cloud(self, frame: int, setup: Setup) -> FloatArray:
        """The phantom's points (n, 3) [m], camera frame, as the recording has them."""
        radius = setup.tool.radius
        if (frame, radius) not in self._cleaned:
            observed = self._experiment.observe(
                self._sequence.name, self._clouds[[frame]], radii=(self._recorded_radius, radius)
            )
            self._cleaned[frame, radius] = observed.clouds[0]
        return self._cleaned[frame, radius]


def _outside(setup: Setup) -> Iterator[str]:
    """Yield a sentence for each part of other stiffness that lies wholly outside the body."""
    for part in setup.material.inclusions:
        line = np.array(part.polyline)
        ways = np.linspace(0.0, len(line) - 1.0, _SAMPLES * len(line))
        along = np.column_stack([np.interp(ways, np.arange(len(line)), axis) for axis in line.T])
        if setup.geometry.outside(along).min() > part.radius:
            kind = "lump" if len(line) == 1 else "tube"
            yield f"the {kind} lies outside the phantom, where it changes nothing"


@lru_cache(maxsize=2)
def _experiment(folder: Path, registered: str) -> Experiment:
    """The experiment of a dataset with a registration (JSON, or null for an automatic one), cached
    for its other sequences: to register a free form takes some ten seconds.
    """
    stored = json.loads(registered)
    accepted = AcceptedRegistration.from_json(stored) if stored else None
    return Experiment.of(open_dataset(folder).registered(accepted))


@lru_cache(maxsize=4)
def open_resolver(
    folder: str, sequence: str, clouds: tuple[int, ...], extended: str
) -> FrameResolver:
    """A resolver, cached for the next question; `extended` is the text of model.json."""
    return FrameResolver(Path(folder), sequence, clouds, json.loads(extended))
