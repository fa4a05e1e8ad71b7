"""Equilibria along a motion of small steps, from few factors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.fem.contact_condensation import Compliance
from palpate.fem.model import BlockModel, Probe
from palpate.fem.newton import Outcome, Solution, misfit, verdict
from palpate.foundation.arrays import FloatArray

__all__ = ["Follower"]

_MOST_STEPS = 12
_TIRED = 5
"""After so many steps in one frame the next one is given a new linearisation."""
_SHRINKING = 0.5
_ATTEMPTS = 4
_LONGEST_PAUSE = 4


class Follower:
    """Keeps the body's linearisation from frame to frame for as long as its steps shrink the
    residual.
    """

    def __init__(self) -> None:
        self._compliance: Compliance | None = None
        self._failures = self._pause = 0

    @property
    def failing(self) -> bool:
        """Whether the last frame was not found so."""
        return self._failures > 0

    def solve(
        self, model: BlockModel, probe: Probe, start: FloatArray, tolerance: float
    ) -> Solution | None:
        """Equilibrium near `start` (n, 3) [m]; None where it takes a full Newton method to find it.

        Failing again and again (as where a base comes loose) it does not even try for some frames.
        """
        if self._pause:
            self._pause -= 1
            return None
        positions, taken = start, 0
        for attempt in range(_ATTEMPTS):
            compliance = self._compliance
            if attempt or compliance is None or not compliance.fits(model):
                compliance = Compliance.at(model, positions, probe)
            if compliance is None:
                break
            solution = self._steps(compliance, model, probe, positions, tolerance)
            positions, taken = solution.positions, taken + solution.iterations
            if solution.converged:
                self._compliance = compliance if solution.iterations <= _TIRED else None
                self._failures = 0
                return replace(solution, iterations=taken)
            if attempt and not solution.iterations:
                break
        self._compliance = None
        self._failures += 1
        self._pause = min(self._failures - 1, _LONGEST_PAUSE)
        return None

    def _steps(
        self,
        compliance: Compliance,
        model: BlockModel,
        probe: Probe,
        positions: FloatArray,
        tolerance: float,
    ) -> Solution:
        """Step while the residual shrinks; the best positions met when that does not reach the
        tolerance.
        """
        state = model.assemble(positions, probe, tangent=False)
        best, residual = state, misfit(model, state)
        for number in range(_MOST_STEPS):
            if residual <= tolerance:
                finite = bool(np.isfinite(model.energy(positions, probe)))
                outcome = verdict(model, probe, positions) if finite else Outcome.INVERTED
                return Solution(positions, best.push, outcome, number, residual, best.penetration)
            trial = compliance.step(model, positions, best.residual, probe)
            if trial is None:
                break
            state = model.assemble(trial, probe, tangent=False)
            now = misfit(model, state)
            if not now < _SHRINKING * residual:
                break
            positions, best, residual = trial, state, now
        return Solution(
            positions, best.push, Outcome.ITERATIONS, number, residual, best.penetration
        )
