"""Equilibrium by Newton's method with a line search on the energy; a motion that is too much at once is split."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from core.fem.factor import NotPositiveDefinite
from core.fem.model import Assembly, BlockModel, Probe
from core.frames import FloatArray

__all__ = ["Outcome", "Solution", "misfit", "solve", "verdict"]

RELATIVE_TOLERANCE = 1e-6
"""Converged: the residual's norm is below this share of the tool's push and of the body's internal forces."""
MAX_ITERATIONS = 40
MAX_SPLITS = 6
MAX_PENETRATION = 4e-4
_LONGEST = 0.5


class Outcome(Enum):
    """How a solve ended, as the sentence a user reads."""

    CONVERGED = "converged"
    ITERATIONS = "no equilibrium within the allowed iterations; the motion between frames is too large or the load too high"
    INDEFINITE = "the stiffness stayed indefinite: the block buckles or an element is almost inverted"
    INVERTED = "an element is inverted at the start of the solve"
    TOOL_SWINGS = "the tool gives way so much that no place was found where its spring balances the block"
    GRIP_SWINGS = "pressure and friction under the tool do not come to agree; the motion between frames is too large"
    INSIDE_TOOL = "the material came to rest inside the tool, or the tool inside the material"


@dataclass(frozen=True, eq=False)
class Solution:
    """Equilibrium positions (n, 3) [m], push of the tool on the body over E (3,) [m^2], and how it was reached."""

    positions: FloatArray
    push: FloatArray
    outcome: Outcome
    iterations: int
    residual: float
    penetration: float

    @property
    def converged(self) -> bool:
        """Whether this is an equilibrium."""
        return self.outcome is Outcome.CONVERGED


def misfit(model: BlockModel, state: Assembly) -> float:
    """The residual's norm over the push, the weight, and a tiny share of E times the base."""
    size = model.setup.geometry.size
    scale = np.linalg.norm(state.push) + model.weight_force.sum() + 1e-5 * size[0] * size[1]
    return float(np.linalg.norm(state.residual) / scale)


def verdict(model: BlockModel, probe: Probe | None, positions: FloatArray) -> Outcome:
    """What a balance of forces is worth: it must not be with the material on the wrong side of the tool."""
    if probe is not None and (model.depth_inside(positions, probe) > MAX_PENETRATION or model.encloses(positions, probe)):
        return Outcome.INSIDE_TOOL
    return Outcome.CONVERGED


def _direction(model: BlockModel, probe: Probe | None, positions: FloatArray, state: Assembly) -> FloatArray | None:
    """Newton step of the unknowns; an indefinite tangent loses the contact's curvature, then is shifted until it has a factor."""
    top = model.topology
    data = state.data
    for shift in (None, 0.0, 1e-2, 1e-1, 1.0, 10.0):
        if shift == 0.0:
            data = model.assemble(positions, probe, bending=False).data
        elif shift is not None:
            data = data.copy()
            data[top.diagonal] += shift * float(np.median(np.abs(data[top.diagonal])))
        try:
            top.factor.factorise(data)
        except NotPositiveDefinite:
            continue
        return -top.factor.solve(state.residual)
    return None


def _search(
    model: BlockModel, probe: Probe | None, positions: FloatArray, step: FloatArray, slope: float, energy: float
) -> tuple[FloatArray, float]:
    """Halve the step until the energy falls as it should (Armijo), rounding allowed for; the same positions when it never does."""
    move = np.zeros_like(positions)
    move[model.topology.free] = step
    # Nothing moves by more than half the tool's radius at once: beyond its centre no contact would be felt.
    length = 1.0 if probe is None else min(1.0, _LONGEST * probe.radius / max(float(np.abs(step).max()), 1e-300))
    for _ in range(12):
        trial = positions + length * move
        value = model.energy(trial, probe)
        if value <= energy + 1e-4 * length * slope + model.rounding:
            return trial, value
        length /= 2
    return positions, energy


def _step(model: BlockModel, probe: Probe | None, positions: FloatArray, energy: float) -> tuple[FloatArray, float, Outcome | None]:
    """One Newton step with a line search; an outcome when there is none."""
    state = model.assemble(positions, probe)
    step = _direction(model, probe, positions, state)
    if step is None:
        return positions, energy, Outcome.INDEFINITE
    trial, value = _search(model, probe, positions, step, float(state.residual @ step), energy)
    return trial, value, Outcome.ITERATIONS if trial is positions else None


def _newton(model: BlockModel, probe: Probe | None, start: FloatArray, tolerance: float) -> Solution:
    positions, energy = start, model.energy(start, probe)
    if not np.isfinite(energy):
        return Solution(start, np.zeros(3), Outcome.INVERTED, 0, np.inf, 0.0)
    outcome, iteration = Outcome.ITERATIONS, 0
    while True:
        state = model.assemble(positions, probe, tangent=False)
        residual = misfit(model, state)
        if residual <= tolerance:
            outcome = verdict(model, probe, positions)
            break
        if iteration == MAX_ITERATIONS:
            break
        iteration += 1
        positions, energy, stopped = _step(model, probe, positions, energy)
        if stopped is not None:
            outcome = stopped
            break
    return Solution(positions, state.push, outcome, iteration, residual, state.penetration)


def solve(
    model: BlockModel,
    probe: Probe | None,
    start: FloatArray,
    before: Probe | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> Solution:
    """Find the equilibrium next to `start` with the tool at `probe`.

    Args:
        model: the block. probe: the tool, or None without one.
        start: (n, 3) positions [m] to begin from, usually those of the frame before.
        before: the tool in that frame; when the whole motion at once finds no equilibrium, it is split between the two.
        tolerance: residual at which to stop, over the push of the tool.

    Returns:
        the solution; look at `outcome`. With a failure the positions are the last ones reached.
    """
    solution = _newton(model, probe, start, tolerance)
    if solution.converged or before is None or probe is None:
        return solution
    for splits in range(1, MAX_SPLITS + 1):
        positions, iterations = start, solution.iterations
        for share in np.linspace(0, 1, 2**splits + 1)[1:]:
            centre = before.centre + share * (probe.centre - before.centre)
            solution = _newton(model, Probe(centre, before.radius + share * (probe.radius - before.radius)), positions, tolerance)
            iterations += solution.iterations
            positions = solution.positions
            if not solution.converged:
                break
        solution = Solution(positions, solution.push, solution.outcome, iterations, solution.residual, solution.penetration)
        if solution.converged:
            return solution
    return solution
