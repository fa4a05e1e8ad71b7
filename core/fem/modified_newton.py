"""Modified Newton method: equilibria along a motion of small steps, from few factors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.fem.contact_condensation import CondensedContact
from palpate.fem.model import Assembly, BlockModel, ToolSphere
from palpate.fem.newton import Outcome, Solution, contact_outcome, relative_residual
from palpate.fem.secant_pairs import SecantPairs
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
        self._pairs = SecantPairs()
        self._failures = self._pause = 0

    @property
    def failing(self) -> bool:
        """Whether the last frame was not found by this method."""
        return self._failures > 0

    def solve(
        self,
        model: BlockModel,
        tool: ToolSphere,
        start: FloatArray,
        state: Assembly,
        tolerance: float,
    ) -> Solution | None:
        """Find the equilibrium near `start` (n, 3) [m]; None if it takes a full Newton method.

        After repeated failures (as where a base comes loose) it skips some frames without trying.

        Args:
            model: the body.
            tool: the tool.
            start: positions to begin from.
            state: assembled there; its tangent is not used.
            tolerance: relative residual at which to stop.
        """
        if self._pause:
            self._pause -= 1
            return None
        positions, taken = start, 0
        for attempt in range(_ATTEMPTS):
            condensed = self._condensed
            if attempt or condensed is None or not condensed.fits(model):
                condensed, self._pairs = (
                    CondensedContact.at(model, positions, tool),
                    SecantPairs(),
                )
            if condensed is None:
                break
            solution, state = self._steps(condensed, model, tool, (positions, state), tolerance)
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
        start: tuple[FloatArray, Assembly],
        tolerance: float,
    ) -> tuple[Solution, Assembly]:
        """Step while the residual shrinks; the best positions found, and the state there, if that
        does not reach the tolerance.
        """
        positions, best = start
        residual, taken = relative_residual(model, best), 0
        self._pairs.begin()
        while True:
            if residual <= tolerance:
                finite = bool(np.isfinite(model.energy(positions, tool)))
                outcome = contact_outcome(model, tool, positions) if finite else Outcome.INVERTED
                break
            outcome = Outcome.ITERATIONS
            plain = condensed.step(model, positions, best.residual, tool)
            if plain is None:
                break
            trial = positions.copy()
            trial[model.topology.free] += self._pairs.corrected(plain)
            state = model.assemble(trial, tool, tangent=False)
            now = relative_residual(model, state)
            if not now < _SHRINKING * residual:
                break
            positions, best, residual, taken = trial, state, now, taken + 1
            if taken == _MOST_STEPS:
                break
        return Solution(positions, best.push, outcome, taken, residual, best.penetration), best
