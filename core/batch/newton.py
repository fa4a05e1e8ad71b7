"""Newton's method for many blocks at once (`core.fem.newton`): each has its own line search, and leaves when done or stuck."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from core.batch.blocks import Blocks, State
from core.batch.contact import Balls
from core.batch.slabs import factorise
from core.batch.stack import Stack
from core.fem.newton import MAX_ITERATIONS

__all__ = ["Balance", "solve"]

_SHIFTS = (0.0, 1e-2, 1e-1, 1.0, 10.0)
"""Of an indefinite tangent's diagonal, over its median, once the contact's curvature is left out."""
_TRIALS = 12


@dataclass(frozen=True, eq=False)
class Balance(Stack):
    """Where the blocks came to.

    Attributes:
        positions: (b, n, 3) [m], the last ones reached. push: over E (b, 3) [m^2]. misfit: (b,) [1]. penetration: (b,) [m].
        iterations: (b,). balanced: (b,) whether the forces are in balance.
    """

    positions: Tensor
    push: Tensor
    misfit: Tensor
    penetration: Tensor
    iterations: Tensor
    balanced: Tensor

    @classmethod
    def before(cls, start: Tensor) -> Balance:
        """Nothing is balanced at positions (b, n, 3) [m] that nobody has looked at."""
        count = start.shape[:1]
        return cls(
            start.clone(), start.new_zeros(*count, 3), start.new_full(count, torch.inf), start.new_zeros(count),
            start.new_zeros(count, dtype=torch.long), start.new_zeros(count, dtype=torch.bool),
        )  # fmt: skip

    def put(self, numbers: Tensor, other: Balance) -> None:
        """Take these blocks' (c,) places from another balance (c, ...)."""
        for name, tensor in vars(other).items():
            getattr(self, name)[numbers] = tensor


@dataclass(frozen=True, eq=False)
class _Going:
    """The blocks that still move: their numbers (c,), tools, positions (c, n, 3) [m] and energies over E (c,) [m^3]."""

    numbers: Tensor
    blocks: Blocks
    balls: Balls
    positions: Tensor
    energy: Tensor

    def only(self, kept: Tensor) -> _Going:
        """Those that a mask (c,) keeps."""
        if bool(kept.all()):
            return self
        i = kept.nonzero().squeeze(1)
        return _Going(self.numbers[i], self.blocks.pick(i), self.balls.pick(i), self.positions[i], self.energy[i])


def solve(blocks: Blocks, balls: Balls, start: Tensor, tolerance: float, dtype: torch.dtype) -> Balance:
    """Equilibria next to `start` (b, n, 3) [m].

    Args:
        tolerance: of the misfit. dtype: of the tangents and their factors; forces and energies are in double precision.
    """
    found, energy = Balance.before(start), blocks.energy(start, balls)
    going = _Going(torch.arange(len(start), device=start.device), blocks, balls, start, energy).only(torch.isfinite(energy))
    for iteration in range(MAX_ITERATIONS + 1):
        if not len(going.numbers):
            break
        state = going.blocks.state(going.positions, going.balls)
        balanced, steps = state.misfit <= tolerance, torch.full_like(going.numbers, iteration)
        found.put(going.numbers, Balance(going.positions, state.push, state.misfit, state.penetration, steps, balanced))
        if iteration < MAX_ITERATIONS:
            going = _step(going.only(~balanced), state.pick(~balanced), dtype)
    return found


def _step(going: _Going, state: State, dtype: torch.dtype) -> _Going:
    """One Newton step of each block; without those that find none."""
    if not len(going.numbers):
        return going
    step, sound = _directions(going, state.residual, dtype)
    slope = (state.residual * step).sum(dim=(1, 2))
    length, placed = torch.ones_like(slope), torch.zeros_like(sound)
    for _ in range(_TRIALS):
        trial = going.positions + length[:, None, None] * step
        value = going.blocks.energy(trial, going.balls)
        placed = value <= going.energy + 1e-4 * length * slope + going.blocks.loads.rounding
        if bool((placed | ~sound).all()):
            break
        length = torch.where(placed, length, length / 2)
    return _Going(going.numbers, going.blocks, going.balls, trial, value).only(placed & sound)


def _directions(going: _Going, residual: Tensor, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Newton steps (c, n, 3) [m], and for whom there is one (c,)."""
    blocks, bending = going.blocks, torch.ones_like(going.energy, dtype=dtype)
    factor = factorise(blocks.frame.layout, blocks.tangent(going.positions, going.balls, bending, dtype))
    step, sound = -factor.solve(residual), factor.sound
    if not bool(sound.all()):
        weak = (~sound).nonzero().squeeze(1)
        step[weak], sound[weak] = _stiffened(going.only(~sound), residual[weak], dtype)
    return step, sound


def _stiffened(going: _Going, residual: Tensor, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """As `_directions` where tangents are indefinite: without the contact's curvature, then shifted until there is a factor."""
    layout, bending = going.blocks.frame.layout, torch.zeros_like(going.energy, dtype=dtype)
    data = going.blocks.tangent(going.positions, going.balls, bending, dtype)
    median = data[:, layout.diagonal].abs().median(dim=1, keepdim=True).values
    step, sound = torch.zeros_like(residual), torch.zeros_like(going.energy, dtype=torch.bool)
    for shift in _SHIFTS:
        weak = (~sound).nonzero().squeeze(1)
        if not len(weak):
            break
        data[:, layout.diagonal] += shift * median
        factor = factorise(layout, data[weak])
        step[weak], sound[weak] = -factor.solve(residual[weak]), factor.sound
    return step, sound
