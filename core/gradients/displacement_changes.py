"""First-order changes of a frame's displacement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.threads import on_one_thread
from palpate.gradients.compliant_tool import CompliantTool
from palpate.gradients.frame_tangent import factorise_at
from palpate.gradients.residual_changes import residual_changes
from palpate.gradients.setup_change import (
    Change,
    is_compliant,
    require_history_free,
    require_same_grid,
)
from palpate.replay.replay import Equilibrium, Replay

__all__ = ["displacement_changes"]


def _is_loaded(block: Replay, frame: Equilibrium) -> bool:
    """Whether the tool or gravity deforms the block."""
    return bool(frame.in_contact or block.setup.load.specific_weight_over_stiffness)


@on_one_thread
def displacement_changes(
    block: Replay, frame: Equilibrium, changes: Sequence[Change], *, exact: bool = True
) -> FloatArray:
    """Displacements that small changes bring about, to first order.

    Args:
        block: the replay that made the frame.
        frame: an equilibrium in contact, or under its own weight.
        changes: (setup, move) pairs: a Setup that differs a little from the block's, and the motion
            of the tool's stated centre that goes with it (3,) [m]. The base may not change between
            fixed and free to move; a base that has slipped stays where it is.
        exact: False gives five digits in half the time.

    Returns:
        (len(changes), n, 3) changes of the nodes' displacement from their rest position [m]; zero
        if neither tool nor gravity loads the block.
    """
    require_history_free(block.setup, *(setup for setup, _ in changes))
    require_same_grid(block, [setup for setup, _ in changes])
    result = np.zeros((len(changes), *frame.displacement.shape))
    model = factorise_at(block, frame) if _is_loaded(block, frame) else None
    if model is None or not changes:
        return result
    factor, right = model.topology.factor, residual_changes(block, frame, model, changes)[0]
    free = factor.solve(right) if exact else factor.approximate(right)
    if is_compliant(block.setup, *(setup for setup, _ in changes)):
        free = CompliantTool(block, frame, model).moved(changes, free)
    result[:, model.topology.free] = free.T
    return result
