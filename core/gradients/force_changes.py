"""First-order changes of the force on the tool."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.gradients.compliant_tool import tool_derivatives
from palpate.gradients.frame_tangent import local_tool
from palpate.gradients.residual_changes import residual_changes
from palpate.gradients.setup_change import Change, is_compliant, require_history_free, tool_shift
from palpate.replay.replay import Equilibrium, Replay

__all__ = ["force_changes"]


def force_changes(
    block: Replay, frame: Equilibrium, changes: Sequence[Change], displacements: FloatArray
) -> FloatArray:
    """Change of the force on the tool (len(changes), 3) [N], to first order.

    With B the change of the residual as the tool moves, the change of the force with the
    displacement is -B', because both derive from one energy.

    Args:
        block: the replay that made the frame.
        frame: an equilibrium.
        changes: as for `displacement_changes`.
        displacements: (len(changes), n, 3) what these changes bring about, as from
            `displacement_changes` [m].
    """
    require_history_free(block.setup, *(setup for setup, _ in changes))
    result = np.zeros((len(changes), 3))
    if not frame.in_contact or not changes:
        return result
    block.dense = frame.dense
    model = block.model(frame.mesh)
    model.harden(frame.hardness)
    positions, here, modulus = (
        frame.mesh.nodes + frame.displacement,
        local_tool(frame),
        block.setup.material.young_modulus,
    )
    model.restrict_to_facing(positions, (here,))
    coupling, harder = tool_derivatives(model, positions, here)
    result = (
        residual_changes(block, frame, model, changes)[1].T
        - displacements[:, model.topology.free] @ coupling
    )
    for number, (setup, move) in enumerate(changes):
        if is_compliant(block.setup, setup):
            # The tool's own motion is ds + dc f + c df, as in `CompliantTool`; H times it is the
            # change of the force.
            compliance = block.setup.tool.compliance_times_stiffness
            driven = (
                tool_shift(block, setup, move)
                + (setup.tool.compliance_times_stiffness - compliance) * frame.force / modulus
            )
            result[number] = np.linalg.solve(
                np.eye(3) + compliance * harder, result[number] - harder @ driven
            )
        result[number] += (setup.material.young_modulus / modulus - 1) * frame.force / modulus
    return result * modulus
