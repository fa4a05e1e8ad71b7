"""From one place of each block's tool to the next, in steps short enough for Newton's method (`core.fem.path`)."""

from __future__ import annotations

import torch
from torch import Tensor

from core.batch.blocks import Blocks
from core.batch.contact import Balls
from core.batch.newton import Balance, solve
from core.fem.path import FREE_STEP, STAGE_TOLERANCE

__all__ = ["lead"]


def lead(blocks: Blocks, positions: Tensor, before: Tensor, balls: Balls, tolerance: float, dtype: torch.dtype) -> Balance:
    """Equilibria with the tools at `balls`, led there from (b, n, 3) [m] with their centres at `before` (b, 3) [m].

    All take their last stage together; a block whose tool has a longer way begins earlier.
    """
    way = balls.centres - before
    stages = (torch.linalg.vector_norm(way, dim=1) / FREE_STEP).ceil().clamp(min=1)
    found, going = Balance.before(positions), torch.ones_like(stages, dtype=torch.bool)
    iterations = torch.zeros_like(found.iterations)
    for left in range(int(stages.max()) - 1, -1, -1):
        now = (going & (stages > left)).nonzero().squeeze(1)
        centres = balls.centres[now] - (left / stages * way.T).T[now]
        rough = max(tolerance, STAGE_TOLERANCE) if left else tolerance
        stage = solve(blocks.pick(now), Balls(centres, balls.radii[now]), found.positions[now], rough, dtype)
        found.put(now, stage)
        iterations[now] += stage.iterations
        going[now] = stage.balanced
    found.iterations.copy_(iterations)
    return found
