"""Modified Newton method: equilibria along a motion of small steps, from few factors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.fem.contact_condensation import CondensedContact
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.newton import Outcome, Solution, contact_outcome, relative_residual
from palpate.foundation.arrays import FloatArray

__all__ = ["ModifiedNewton"]

_MOST_STEPS = 12
_TIRED = 5
"""Steps in one frame after which the next frame gets a new linearisation."""
_SHRINKING = 0.5
_ATTEMPTS = 4
_LONGEST_PAUSE = 4


class ModifiedNewton:
    """Solver that keeps the body's linearisation from frame to frame while its steps shrink the
    residual.
    """

    def __init__(self) -> None:
        self._condensed: CondensedContact | None = None
        self._failures = self._pause = 0

    @property
    def failing(self) -> bool:
        """Whether the last frame was not found by this method."""
        return self._failures > 0

    def solve(
        self, model: BlockModel, tool: ToolSphere, start: FloatArray, tolerance: float
    ) -> Solution | None:
        """Find the equilibrium near `start` (n, 3) [m]; None if it takes a full Newton method.

        After repeated failures (as where a base comes loose) it skips some frames without trying.
        """
        if self._pause:
            self._pause -= 1
            return None
        positions, taken = start, 0
        for attempt in range(_ATTEMPTS):
            condensed = self._condensed
            if attempt or condensed is None or not condensed.fits(model):
                condensed = CondensedContact.at(model, positions, tool)
            if condensed is None:
                break
            solution = self._steps(condensed, model, tool, positions, tolerance)
            positions, taken = solution.positions, taken + solution.iterations
            if solution.converged:
                self._condensed = condensed if solution.iterations <= _TIRED else None
                self._failures = 0
                return replace(solution, iterations=taken)
            if attempt and not solution.iterations:
                break
        self._condensed = None
        self._failures += 1
        self._pause = min(self._failures - 1, _LONGEST_PAUSE)
        return None

    def _steps(
        self,
        condensed: CondensedContact,
        model: BlockModel,
        tool: ToolSphere,
        positions: FloatArray,
        tolerance: float,
    ) -> Solution:
        """Step while the residual shrinks; the best positions found if that does not reach the
        tolerance.
        """
        state = model.assemble(positions, tool, tangent=False)
        best, residual = state, relative_residual(model, state)
        for number in range(_MOST_STEPS):
            if residual <= tolerance:
                finite = bool(np.isfinite(model.energy(positions, tool)))
                outcome = contact_outcome(model, tool, positions) if finite else Outcome.INVERTED
                return Solution(positions, best.push, outcome, number, residual, best.penetration)
            trial = condensed.step(model, positions, best.residual, tool)
            if trial is None:
                break
            state = model.assemble(trial, tool, tangent=False)
            now = relative_residual(model, state)
            if not now < _SHRINKING * residual:
                break
            positions, best, residual = trial, state, now
        return Solution(
            positions, best.push, Outcome.ITERATIONS, number, residual, best.penetration
        )
