"""From one place of the tool to the next, in steps short enough for Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np

from palpate.fem.model import BlockModel, Probe
from palpate.fem.modified_newton import Follower
from palpate.fem.newton import MAX_PENETRATION, Outcome, Solution, misfit, solve
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Shape

__all__ = ["DEEPEST", "FREE_STEP", "STAGE_TOLERANCE", "first_touch", "lead"]

FREE_STEP = 1.5e-3
"""Longest motion in contact [m] that is tried at once."""
STAGE_TOLERANCE = 0.2
"""Residual at which a place on the way counts as reached: the next stage only begins from it."""

DEEPEST = 2e-4
"""Penetration [m] from which on the contact is hardened, by _HARDER at a time, to _HARDEST times
what it is at first."""
_HARDER, _HARDEST = 4.0, 64.0
_HALVINGS = 40
"""Of the way to the first touch, down to rounding: a rough one jumps as the tool's place or radius
changes."""


def lead(
    model: BlockModel,
    positions: FloatArray,
    before: Probe,
    probe: Probe,
    tolerance: float,
    follower: Follower,
    *,
    haste: bool = False,
) -> Solution:
    """Equilibrium at `probe`, led there from an equilibrium (n, 3) [m] with the tool at `before`;
    in haste only if that is easy.

    Where the tool is pressed in so hard that the contact's penalty gives way, the contact is
    hardened step by step.
    """
    model.harden(1.0)
    solution = _led(model, positions, (before, probe), tolerance, follower, haste)
    while solution.converged and model.notice(solution.positions, probe):
        wary = solve(model, probe, solution.positions, probe, tolerance)
        solution = replace(wary, iterations=solution.iterations + wary.iterations)
    while solution.converged and solution.penetration > DEEPEST and model.hardness < _HARDEST:
        model.harden(_HARDER * model.hardness)
        harder = solve(model, probe, solution.positions, probe, tolerance)
        solution = replace(harder, iterations=solution.iterations + harder.iterations)
    if (
        solution.converged and solution.penetration > MAX_PENETRATION
    ):  # what is held cannot make way, however hard the contact
        return replace(solution, outcome=Outcome.INSIDE_TOOL)
    return solution


def _led(
    model: BlockModel,
    positions: FloatArray,
    probes: tuple[Probe, Probe],
    tolerance: float,
    follower: Follower,
    haste: bool,
) -> Solution:
    """Places on the way are reached roughly at first; where that leads astray, the way is gone
    again with care.
    """
    before, probe = probes
    steps = max(1, int(np.ceil(float(np.linalg.norm(probe.centre - before.centre)) / FREE_STEP)))
    if steps == 1:
        near = follower.solve(model, probe, _carried(model, positions, before, probe), tolerance)
        return (
            near
            if near is not None
            else solve(model, probe, positions, None if haste else before, tolerance)
        )
    stages = [
        Probe(before.centre + share * (probe.centre - before.centre), probe.radius)
        for share in np.arange(1, steps) / steps
    ]
    hasty = _through(model, positions, [before, *stages, probe], tolerance, follower, careful=False)
    if hasty.converged or haste:
        return hasty
    careful = _through(model, positions, [before, *stages, probe], tolerance, None, careful=True)
    return replace(careful, iterations=hasty.iterations + careful.iterations)


def _carried(model: BlockModel, positions: FloatArray, before: Probe, probe: Probe) -> FloatArray:
    """Positions (n, 3) [m] from which a step begins: those given, or with the surface carried along
    as the ball moves and grows.

    A ball that draws back or shrinks loses touch with a body that stays where it is, whose whole
    push is then out of balance.
    """
    arm = positions - before.centre
    distance = np.linalg.norm(arm, axis=1, keepdims=True)
    reach = np.exp(-((np.maximum(distance / before.radius - 1.0, 0.0)) ** 2))
    move = reach * (
        probe.centre
        - before.centre
        + (probe.radius - before.radius) * arm / np.maximum(distance, 1e-12)
    )
    carried = np.where(model.topology.free, positions + move, positions)
    there, here = (model.assemble(place, probe, tangent=False) for place in (carried, positions))
    return carried if misfit(model, there) < misfit(model, here) else positions


def _through(
    model: BlockModel,
    positions: FloatArray,
    probes: list[Probe],
    tolerance: float,
    follower: Follower | None,
    careful: bool,
) -> Solution:
    """The last of the solutions at each place after the first, or the first that is none."""
    rough = tolerance if careful else max(tolerance, STAGE_TOLERANCE)
    iterations = 0
    for last, probe in pairwise(probes):
        wanted = tolerance if probe is probes[-1] else rough
        near = None
        if follower is not None:
            near = follower.solve(model, probe, _carried(model, positions, last, probe), wanted)
        solution = (
            near
            if near is not None
            else solve(model, probe, positions, last if careful else None, wanted)
        )
        iterations += solution.iterations
        if not solution.converged:
            break
        positions = solution.positions
    return replace(solution, iterations=iterations)


def first_touch(
    before: Probe, probe: Probe, body: Box | Shape, away: Callable[[Probe], bool]
) -> Probe:
    """The last place on the way to `probe` that is clear of the body at rest, as `away` tells."""
    low, high = 0.0, 1.0
    if np.linalg.norm(before.centre - probe.centre) > 1.0 or not away(before):
        middle = (body.low + body.high) / 2
        before = Probe(
            probe.centre + (probe.centre - middle) / np.linalg.norm(probe.centre - middle) * 0.05,
            probe.radius,
        )
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        clear = away(Probe(before.centre + share * (probe.centre - before.centre), probe.radius))
        low, high = (share, high) if clear else (low, share)
    return Probe(before.centre + low * (probe.centre - before.centre), probe.radius)
