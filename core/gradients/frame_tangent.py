"""The factorised tangent at a frame's equilibrium."""

from __future__ import annotations

import numpy as np

from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import BlockModel, ToolSphere
from palpate.replay.replay import Equilibrium, Replay

__all__ = ["factorise_at", "local_tool"]


def factorise_at(block: Replay, frame: Equilibrium) -> BlockModel | None:
    """Factorise the tangent at a frame's equilibrium; None if it has no Cholesky factor."""
    block.dense = frame.dense
    model = block.model(frame.mesh)
    model.harden(frame.hardness)
    model.restrict_to_facing(frame.mesh.nodes + frame.displacement, (local_tool(frame),))
    known = (frame, model, model.topology.factor.generation)
    if block.material_history is None and block.factorised == known:
        return model
    state = model.assemble(frame.mesh.nodes + frame.displacement, local_tool(frame))
    try:
        model.factorise(state.data)
    except NotPositiveDefinite:
        return None
    block.factorised = (frame, model, model.topology.factor.generation)
    return model


def local_tool(frame: Equilibrium) -> ToolSphere:
    """The tool in the frame of the block, which may have slipped."""
    return ToolSphere(frame.tool.centre - np.append(frame.slip, 0.0), frame.tool.radius)
