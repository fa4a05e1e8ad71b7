"""Equilibrium by Newton's method with a line search on the energy; long motions are split."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import Assembly, BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray

__all__ = [
    "MAX_PENETRATION",
    "Outcome",
    "Solution",
    "blocked_by_base",
    "contact_outcome",
    "relative_residual",
    "solve",
]

RELATIVE_TOLERANCE = 1e-6
"""Converged: the residual's norm is below this share of the tool's push and of the weight."""
MAX_ITERATIONS = 40
MAX_SPLITS, _MOST_ITERATIONS = 6, 400
"""Halvings of a motion that is split, and Newton steps in all its parts."""
MAX_PENETRATION = 4e-4
"""Largest penetration of the surface into the tool that counts as contact [m]."""
_LONGEST = 0.5


class Outcome(Enum):
    """Result of a solve, as the sentence a user reads."""

    CONVERGED = "converged"
    ITERATIONS = (
        "no equilibrium within the allowed iterations; "
        "the motion between frames is too large or the load too high"
    )
    INDEFINITE = (
        "the stiffness stayed indefinite: the body buckles or an element is almost inverted"
    )
    INVERTED = "an element is inverted at the start of the solve"
    TOOL_SWINGS = (
        "the tool's mount is so compliant that no place was found "
        "where its spring balances the body"
    )
    BASE_SLIDES = "the base keeps sliding and finds no place where friction holds it"
    GRIP_SWINGS = (
        "pressure and friction under the tool do not agree; the motion between frames is too large"
    )
    BASE_IN_TOOL = "the tool reaches into the base, which is fixed: nothing can yield to it"
    INSIDE_TOOL = "the material came to rest inside the tool, or the tool inside the material"
    GIVEN_UP = (
        "the push was given up, for it takes more work than any push may; "
        "look at its first frame without equilibrium"
    )
    PULLED = (
        "the body came to rest on the wrong side of the tool and pulls it, which contact cannot"
    )
    STEPS_DIFFER = (
        "a long motion at once ends in an equilibrium that small steps do not reach; "
        "move the tool in smaller steps"
    )

    @property
    def code(self) -> int:
        """Number in recordings: 0 for `CONVERGED`; 1 is not used, since old recordings have it for
        all others.
        """
        number = list(Outcome).index(self)
        return number + 1 if number else 0

    @staticmethod
    def reason(code: int) -> str:
        """The sentence of a recorded number that is not 0."""
        known = {one.code: one.value for one in Outcome}
        return known.get(code, "no equilibrium; the reason was not recorded")


@dataclass(frozen=True, eq=False)
class Solution:
    """Node positions and how they were reached.

    Attributes:
        positions: (n, 3) [m].
        push: of the tool on the body over E (3,) [m^2].
        outcome: whether this is an equilibrium, or why not.
        iterations: number of Newton steps.
        residual: relative.
        penetration: of the surface into the tool [m].
    """

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


def relative_residual(model: BlockModel, state: Assembly) -> float:
    """The residual's norm over the push, the weight, and a tiny share of E times the base area."""
    size = model.setup.geometry.size
    scale = np.linalg.norm(state.push) + model.weight_force.sum() + 1e-5 * size[0] * size[1]
    return float(np.linalg.norm(state.residual) / scale)


def contact_outcome(model: BlockModel, tool: ToolSphere | None, positions: FloatArray) -> Outcome:
    """Outcome of a balance of forces: the material must not be on the wrong side of the tool."""
    if tool is None:
        return Outcome.CONVERGED
    inside = (
        model.depth_inside(positions, tool) > MAX_PENETRATION
        or _unfelt_depth(model, positions, tool) > MAX_PENETRATION
    )
    return Outcome.INSIDE_TOOL if inside or model.encloses(positions, tool) else Outcome.CONVERGED


def _unfelt_depth(model: BlockModel, positions: FloatArray, tool: ToolSphere) -> float:
    """Depth inside the tool [m] of the deepest surface point without contact force, as in a
    fold.
    """
    apart = model.face.shapes @ positions[model.topology.surface] - tool.centre
    if (
        np.einsum("fqi,fqi->fq", apart, apart).min() > max(0.0, tool.radius - MAX_PENETRATION) ** 2
    ):  # the usual, and cheap
        return 0.0
    facing, depth = model.facing(positions, tool)
    return float(depth[~(model.areas > 0 if model.dense else facing)].max(initial=0.0))


def blocked_by_base(model: BlockModel, positions: FloatArray, tool: ToolSphere) -> Solution | None:
    """A failed solution if the tool reaches into fixed nodes; else None.

    Args:
        model: the body.
        positions: (n, 3) for the solution [m].
        tool: the tool.
    """
    held = model.mesh.nodes[~model.topology.free.any(axis=1)]
    depth = tool.radius - float(np.linalg.norm(held - tool.centre, axis=1).min(initial=np.inf))
    return (
        Solution(positions, np.zeros(3), Outcome.BASE_IN_TOOL, 0, np.inf, depth)
        if depth > MAX_PENETRATION
        else None
    )


def _direction(
    model: BlockModel, tool: ToolSphere | None, positions: FloatArray, state: Assembly
) -> tuple[FloatArray, bool] | None:
    """Newton step of the unknowns, and whether it is exact; None if there is none.

    An indefinite tangent loses the contact's curvature, then is shifted until it has a factor.
    """
    top = model.topology
    data = state.data
    for shift in (None, 0.0, 1e-2, 1e-1, 1.0, 10.0):
        if shift == 0.0:
            data = model.assemble(positions, tool, bending=False).data
        elif shift is not None:
            data = data.copy()
            data[top.diagonal] += shift * float(np.median(np.abs(data[top.diagonal])))
        try:
            model.factorise(data)
        except NotPositiveDefinite:
            continue
        return -top.factor.approximate(state.residual), shift is None
    return None


def _search(
    model: BlockModel,
    tool: ToolSphere | None,
    positions: FloatArray,
    step: FloatArray,
    slope: float,
    energy: float,
    exact: bool,
) -> tuple[FloatArray, float]:
    """Halve the step until the energy falls enough (Armijo), up to rounding.

    An inexact step is too short where the body yields, and is doubled while the energy falls.

    Returns:
        new positions and energy; the same positions if the energy never falls.
    """
    move = np.zeros_like(positions)
    move[model.topology.free] = step
    # No node moves by more than half the tool's radius at once: beyond the tool's centre contact
    # has no effect.
    longest = (
        np.inf if tool is None else _LONGEST * tool.radius / max(float(np.abs(step).max()), 1e-300)
    )
    length = min(1.0, longest)
    for halvings in range(12):
        trial = positions + length * move
        value = model.energy(trial, tool)
        if value <= energy + 1e-4 * length * slope + model.rounding:
            return (
                (trial, value)
                if exact or halvings
                else _stretched(model, tool, positions, move, (length, longest), value)
            )
        length /= 2
    return positions, energy


def _stretched(
    model: BlockModel,
    tool: ToolSphere | None,
    positions: FloatArray,
    move: FloatArray,
    lengths: tuple[float, float],
    energy: float,
) -> tuple[FloatArray, float]:
    """Double a step while the energy falls.

    Args:
        lengths: of the step, and upper bound of the doubled one.
        energy: after the step.
    """
    length, longest = lengths
    while 2 * length < longest:
        value = model.energy(positions + 2 * length * move, tool)
        if not value < energy:
            break
        length, energy = 2 * length, value
    return positions + length * move, energy


def _step(
    model: BlockModel, tool: ToolSphere | None, positions: FloatArray, energy: float
) -> tuple[FloatArray, float, Outcome | None]:
    """One Newton step with a line search; an outcome if there is none."""
    state = model.assemble(positions, tool)
    direction = _direction(model, tool, positions, state)
    if direction is None:
        return positions, energy, Outcome.INDEFINITE
    step, exact = direction
    trial, value = _search(
        model, tool, positions, step, float(state.residual @ step), energy, exact
    )
    return trial, value, Outcome.ITERATIONS if trial is positions else None


def _newton(
    model: BlockModel, tool: ToolSphere | None, start: FloatArray, tolerance: float
) -> Solution:
    positions, energy = start, model.energy(start, tool)
    if not np.isfinite(energy):
        return Solution(start, np.zeros(3), Outcome.INVERTED, 0, np.inf, 0.0)
    outcome, iteration = Outcome.ITERATIONS, 0
    while True:
        if tool is not None and model.add_penetrated(positions, tool):
            energy = model.energy(positions, tool)
        state = model.assemble(positions, tool, tangent=False)
        residual = relative_residual(model, state)
        if residual <= tolerance:
            outcome = contact_outcome(model, tool, positions)
            break
        if iteration == MAX_ITERATIONS:
            break
        iteration += 1
        positions, energy, stopped = _step(model, tool, positions, energy)
        if stopped is not None:
            outcome = stopped
            break
    return Solution(positions, state.push, outcome, iteration, residual, state.penetration)


def solve(
    model: BlockModel,
    tool: ToolSphere | None,
    start: FloatArray,
    before: ToolSphere | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
) -> Solution:
    """Find the equilibrium next to `start` with the tool at `tool`.

    Args:
        model: the body.
        tool: None without a tool.
        start: (n, 3) positions to begin from [m], usually those of the frame before.
        before: the tool in that frame; if the whole motion at once finds no equilibrium, it is
            split between the two.
        tolerance: relative residual at which to stop.

    Returns:
        the solution; see `outcome`. After a failure the positions are the last ones reached.
    """
    solution = _newton(model, tool, start, tolerance)
    if solution.converged or before is None or tool is None or before is tool:
        return solution
    return _split(model, (before, tool), start, tolerance, solution)


def _split(
    model: BlockModel,
    tools: tuple[ToolSphere, ToolSphere],
    start: FloatArray,
    tolerance: float,
    solution: Solution,
) -> Solution:
    """Move the tool in parts, halved after a failure and doubled after two successes."""
    before, tool = tools
    done, part, eased, iterations = 0.0, 0.5, False, solution.iterations
    while done < 1.0 and part >= 0.5**MAX_SPLITS and iterations < _MOST_ITERATIONS:
        share = min(done + part, 1.0)
        centre = before.centre + share * (tool.centre - before.centre)
        solution = _newton(
            model,
            ToolSphere(centre, before.radius + share * (tool.radius - before.radius)),
            start,
            tolerance,
        )
        iterations += solution.iterations
        if solution.converged:
            start, done, part, eased = (
                solution.positions,
                share,
                2 * part if eased else part,
                not eased,
            )
        else:
            part, eased = part / 2, False
    if solution.converged and done < 1.0:
        solution = replace(solution, outcome=Outcome.ITERATIONS)
    return replace(solution, iterations=iterations)
