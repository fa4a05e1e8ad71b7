"""A simulated sequence: one equilibrium per frame, with force, surface and outcome."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.replay.equilibrium import Equilibrium

if TYPE_CHECKING:
    from palpate.experiment.experiment import Experiment

__all__ = ["ReplayedSequence"]


@dataclass(frozen=True, eq=False)
class ReplayedSequence:
    """The replay of one sequence.

    Attributes:
        experiment: what was replayed.
        sequence: its name.
        times: (f,) stamps of the frames [s].
        cloud_index: (f,) cloud of each frame; None for a sequence without clouds.
        centres: (f, 3) tool centres under the model [m], phantom frame.
        frames: the equilibria.
    """

    experiment: Experiment
    sequence: str
    times: FloatArray
    cloud_index: IntArray | None
    centres: FloatArray
    frames: tuple[Equilibrium, ...]

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def force(self) -> FloatArray:
        """Force of the phantom on the tool (f, 3) [N], phantom frame."""
        return np.array([frame.force for frame in self.frames]).reshape(-1, 3)

    @property
    def failed(self) -> IntArray:
        """Frames (k,) for which no equilibrium was found."""
        return np.flatnonzero([frame.outcome is not Outcome.CONVERGED for frame in self.frames])

    def surface(self, points: FloatArray) -> FloatArray:
        """Places (f, n, 3) [m] of material points (n, 3) [m] at rest, phantom frame."""
        return np.array([frame.move(points) for frame in self.frames]).reshape(
            len(self.frames), -1, 3
        )
