"""Changes of the residual and of the tool's push at a fixed displacement."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.fem.model import BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray
from palpate.gradients.frame_tangent import local_tool
from palpate.gradients.setup_change import Change, is_compliant, mesh_in, same_body, tool_shift
from palpate.replay.replay import Equilibrium, Replay

__all__ = ["residual_changes"]


def residual_changes(
    block: Replay, frame: Equilibrium, model: BlockModel, changes: Sequence[Change]
) -> tuple[FloatArray, FloatArray]:
    """Minus the changes of the residual and of the tool's push, at the frame's displacement.

    A compliant tool stays where it is here; `palpate.gradients.compliant_tool` moves it.

    Returns:
        (u, len(changes)) of the residual and (3, len(changes)) of the push, both over E [m^2].
    """
    positions, here = frame.mesh.nodes + frame.displacement, local_tool(frame)
    state = model.assemble(positions, here, tangent=False)
    right, eased = np.zeros((len(state.residual), len(changes))), np.zeros((3, len(changes)))
    for column, (setup, move) in enumerate(changes):
        same = same_body(block, setup)
        shift = np.zeros(3) if is_compliant(block.setup, setup) else tool_shift(block, setup, move)
        # Without a change of body, radius or place only the sensor differs.
        if same and setup.tool.radius == block.setup.tool.radius and not shift.any():
            continue
        other = (
            model if same else BlockModel(setup, mesh_in(block, setup, frame), dense=frame.dense)
        )
        there = other.mesh.nodes + frame.displacement
        other.harden(frame.hardness)
        other.restrict_to_facing(there, (here,))
        tool = ToolSphere(
            here.centre + shift, here.radius + setup.tool.radius - block.setup.tool.radius
        )
        changed = other.assemble(there, tool, tangent=False)
        right[:, column], eased[:, column] = (
            state.residual - changed.residual,
            state.push - changed.push,
        )
    return right, eased
