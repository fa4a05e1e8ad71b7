"""Motion of a tool on a spring that a small change brings about."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.fem.model import BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray
from palpate.gradients.frame_tangent import local_tool
from palpate.gradients.setup_change import Change, is_compliant, mesh_in, tool_shift
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = ["CompliantTool", "tool_derivatives"]

_SLOPE_STEP = 1e-9
"""Motion of the tool for differences that are compared with the tangent [m]. Measured: half a point
that comes into contact changes a gradient by a tenth, so the step is shorter than TOOL_STEP."""


def tool_derivatives(
    model: BlockModel, positions: FloatArray, tool: ToolSphere
) -> tuple[FloatArray, FloatArray]:
    """Derivatives by the tool's motion: of the residual (u, 3) and of minus the force on it (3, 3).

    Both are over E [m].
    """
    residuals, forces = np.empty((int(model.topology.free.sum()), 3)), np.empty((3, 3))
    for column, axis in enumerate(np.eye(3)):
        places = [
            ToolSphere(tool.centre + sign * _SLOPE_STEP * axis, tool.radius) for sign in (1, -1)
        ]
        ahead, behind = (model.assemble(positions, place, tangent=False) for place in places)
        residuals[:, column] = (ahead.residual - behind.residual) / (2 * _SLOPE_STEP)
        forces[:, column] = (ahead.push - behind.push) / (2 * _SLOPE_STEP)
    return residuals, forces


class CompliantTool:
    """First-order response of a tool on a spring, at a frame whose tangent is factorised.

    With y its centre, s its stated centre, c its compliance times E and f the force on it over E,
    y = s + c f. So, with B the change of the residual and -H that of f as y moves, A = K^-1 B and
    `free` the change of the displacement at a fixed tool,

        (1 + c (H - B' A)) dy = ds + dc f + c (df - B' free),    du = free - A dy.

    Changes between setups without a spring move nothing here.

    Attributes:
        coupling: B (u, 3) [m].
        answer: A = K^-1 B.
    """

    def __init__(self, block: Replay, frame: Equilibrium, model: BlockModel) -> None:
        self._block, self._model, self._here = block, model, local_tool(frame)
        self._frame = frame
        self._positions = frame.mesh.nodes + frame.displacement
        self._compliance = block.setup.tool.compliance_times_stiffness
        state = model.assemble(self._positions, self._here, tangent=False)
        self._force = -state.push
        self.coupling, harder = tool_derivatives(model, self._positions, self._here)
        self.answer = model.topology.factor.solve(self.coupling)
        self._inverse = np.linalg.inv(
            np.eye(3) + self._compliance * (harder - self.answer.T @ self.coupling)
        )

    def moved(self, changes: Sequence[Change], free: FloatArray) -> FloatArray:
        """Change of the displacement (u, len(changes)) [m], from that at a fixed tool.

        The tangent must be symmetric.
        """
        driven = self.driven(changes) - self._compliance * (self.coupling.T @ free)
        return np.asarray(free - self.answer @ (self._inverse @ driven))

    def driven(self, changes: Sequence[Change]) -> FloatArray:
        """Drive of the tool's motion, ds + dc f + c df (3, len(changes)) [m]."""
        result = np.zeros((3, len(changes)))
        for column, (setup, move) in enumerate(changes):
            if not is_compliant(self._block.setup, setup):
                continue
            softer = setup.tool.compliance_times_stiffness - self._compliance
            result[:, column] = (
                tool_shift(self._block, setup, move)
                + softer * self._force
                + self._compliance * self._force_change(setup)
            )
        return result

    def _force_change(self, setup: Setup) -> FloatArray:
        """Change of the force on the tool over E (3,) [m^2] at a fixed displacement.

        It comes from another radius or another surface.
        """
        wider, model = setup.tool.radius - self._block.setup.tool.radius, self._model
        mesh = mesh_in(self._block, setup, self._frame)
        if not wider and mesh is model.mesh:
            return np.zeros(3)
        if mesh is not model.mesh:
            model = BlockModel(setup, mesh, dense=model.dense)
            model.harden(self._model.hardness)
        positions = self._positions + (mesh.nodes - self._model.mesh.nodes)
        state = model.assemble(
            positions, ToolSphere(self._here.centre, self._here.radius + wider), tangent=False
        )
        return np.asarray(-state.push - self._force)
