"""Load continuation: from one tool position to the next in steps short enough for Newton's
method.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from palpate.fem.model import Assembly, BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import MAX_PENETRATION, Outcome, Solution, relative_residual, solve
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Shape

__all__ = ["FREE_STEP", "HARDENING_PENETRATION", "STAGE_TOLERANCE", "first_touch", "move_tool"]

FREE_STEP = 1.5e-3
"""Longest motion in contact that is tried in one step [m]."""
STAGE_TOLERANCE = 0.2
"""Relative residual at which an intermediate position counts as reached; only the next stage starts
from it."""

HARDENING_PENETRATION = 2e-4
"""Penetration [m] above which the contact is hardened, by _HARDER at a time, to at most _HARDEST
times its initial stiffness."""
_HARDER, _HARDEST = 4.0, 64.0
_HALVINGS = 40
"""Bisections of the path to first contact, down to rounding: a rough solution jumps as the tool's
position or radius changes."""


def move_tool(
    model: BlockModel,
    positions: FloatArray,
    before: ToolSphere,
    tool: ToolSphere,
    tolerance: float,
    quick_solver: ModifiedNewton,
    *,
    haste: bool = False,
) -> Solution:
    """Find the equilibrium with the tool at `tool`, from one with the tool at `before`.

    If penetration under the pressed tool is too large for the contact's penalty, the contact is
    hardened step by step.

    Args:
        model: the body.
        positions: (n, 3) equilibrium with the tool at `before` [m].
        before: tool at the start.
        tool: tool at the end.
        tolerance: relative residual at which to stop.
        quick_solver: modified Newton method, tried first.
        haste: give up if the quick solver and a plain Newton step fail.
    """
    model.harden(1.0)
    solution = _move_in_stages(model, positions, (before, tool), tolerance, quick_solver, haste)
    while solution.converged and model.add_penetrated(solution.positions, tool):
        checked = solve(model, tool, solution.positions, tool, tolerance)
        solution = replace(checked, iterations=solution.iterations + checked.iterations)
    while (
        solution.converged
        and solution.penetration > HARDENING_PENETRATION
        and model.hardness < _HARDEST
    ):
        model.harden(_HARDER * model.hardness)
        harder = solve(model, tool, solution.positions, tool, tolerance)
        solution = replace(harder, iterations=solution.iterations + harder.iterations)
    if (
        solution.converged and solution.penetration > MAX_PENETRATION
    ):  # what is held cannot make way, however hard the contact
        return replace(solution, outcome=Outcome.INSIDE_TOOL)
    return solution


def _move_in_stages(
    model: BlockModel,
    positions: FloatArray,
    tools: tuple[ToolSphere, ToolSphere],
    tolerance: float,
    quick_solver: ModifiedNewton,
    haste: bool,
) -> Solution:
    """Move the tool through intermediate positions.

    They are solved roughly at first; if that fails, the path is repeated with full tolerance.
    """
    before, tool = tools
    steps = max(1, int(np.ceil(float(np.linalg.norm(tool.centre - before.centre)) / FREE_STEP)))
    if steps == 1:
        near = quick_solver.solve(
            model, tool, *_predicted_positions(model, positions, before, tool), tolerance
        )
        return (
            near
            if near is not None
            else solve(model, tool, positions, None if haste else before, tolerance)
        )
    stages = [
        ToolSphere(before.centre + share * (tool.centre - before.centre), tool.radius)
        for share in np.arange(1, steps) / steps
    ]
    hasty = _pass_stages(
        model, positions, [before, *stages, tool], tolerance, quick_solver, careful=False
    )
    if hasty.converged or haste:
        return hasty
    careful = _pass_stages(model, positions, [before, *stages, tool], tolerance, None, careful=True)
    return replace(careful, iterations=hasty.iterations + careful.iterations)


def _predicted_positions(
    model: BlockModel, positions: FloatArray, before: ToolSphere, tool: ToolSphere
) -> tuple[FloatArray, Assembly]:
    """Positions (n, 3) [m] from which a step begins, and their residual.

    They are those given, or with the surface predicted along as the ball moves and grows, whichever
    has the smaller residual. A ball that retreats or shrinks loses contact with a body that stays
    in place, so that its whole push would be out of balance.
    """
    arm = positions - before.centre
    distance = np.linalg.norm(arm, axis=1, keepdims=True)
    reach = np.exp(-((np.maximum(distance / before.radius - 1.0, 0.0)) ** 2))
    move = reach * (
        tool.centre
        - before.centre
        + (tool.radius - before.radius) * arm / np.maximum(distance, 1e-12)
    )
    predicted = np.where(model.topology.free, positions + move, positions)
    there, here = (model.assemble(place, tool, tangent=False) for place in (predicted, positions))
    if relative_residual(model, there) < relative_residual(model, here):
        return predicted, there
    return positions, here


def _pass_stages(
    model: BlockModel,
    positions: FloatArray,
    tools: list[ToolSphere],
    tolerance: float,
    quick_solver: ModifiedNewton | None,
    careful: bool,
) -> Solution:
    """Solve at each tool position after the first; returns the last solution, or the first that
    fails.
    """
    rough = tolerance if careful else max(tolerance, STAGE_TOLERANCE)
    iterations = 0
    for last, tool in pairwise(tools):
        required = tolerance if tool is tools[-1] else rough
        near = None
        if quick_solver is not None:
            near = quick_solver.solve(
                model, tool, *_predicted_positions(model, positions, last, tool), required
            )
        solution = (
            near
            if near is not None
            else solve(model, tool, positions, last if careful else None, required)
        )
        iterations += solution.iterations
        if not solution.converged:
            break
        positions = solution.positions
    return replace(solution, iterations=iterations)


def first_touch(
    before: ToolSphere, tool: ToolSphere, body: Box | Shape, is_clear: Callable[[ToolSphere], bool]
) -> ToolSphere:
    """The last position on the path to `tool` at which the tool does not touch the body at rest.

    Args:
        before: tool at the start.
        tool: tool at the end.
        body: geometry.
        is_clear: whether a tool does not touch.
    """
    low, high = 0.0, 1.0
    if np.linalg.norm(before.centre - tool.centre) > 1.0 or not is_clear(before):
        middle = (body.low + body.high) / 2
        before = ToolSphere(
            tool.centre + (tool.centre - middle) / np.linalg.norm(tool.centre - middle) * 0.05,
            tool.radius,
        )
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        clear = is_clear(
            ToolSphere(before.centre + share * (tool.centre - before.centre), tool.radius)
        )
        low, high = (share, high) if clear else (low, share)
    return ToolSphere(before.centre + low * (tool.centre - before.centre), tool.radius)
