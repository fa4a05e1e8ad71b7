"""How a frame's displacement changes with anything in the Setup: one extra solve on a factor that
is there already.

At equilibrium the residual R(u, p) vanishes, so du/dp = -K^-1 dR/dp (implicit function theorem).
dR/dp is taken by asking the changed Setup for its residual at the same displacement; thus any
effect has its sensitivity without knowing the solver. A setup with history has none here: its frame
depends on all the frames before it, which the change would have changed, too.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.foundation.threads import on_one_thread
from palpate.mesh.box_mesh import BoxMesh
from palpate.mesh.protocol import Mesh
from palpate.replay.material_history import require_memoryless
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Setup

__all__ = [
    "TOOL_STEP",
    "Change",
    "CompliantTool",
    "displacement_changes",
    "factorise_at",
    "force_changes",
    "is_compliant",
    "local_tool",
    "mesh_in",
    "require_history_free",
    "require_same_grid",
    "same_body",
    "tool_derivatives",
]

Change = tuple[Setup, FloatArray]
"""A Setup that differs a little from the block's, and how the tool's stated centre moves with it
(3,) [m]."""

TOOL_STEP = 5e-7
"""Motion of the tool [m] over which residuals are differenced: so short that no further surface
point comes into touch."""

_SLOPE_STEP = 1e-9
"""The same where it is played off against the tangent [m]: half a point that comes into touch was a
tenth of a gradient."""


def factorise_at(block: Replay, frame: Equilibrium) -> BlockModel | None:
    """Factorise the tangent at a frame's equilibrium; None when it has no Cholesky factor."""
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
    """The tool as the slid block sees it."""
    return ToolSphere(frame.tool.centre - np.append(frame.slip, 0.0), frame.tool.radius)


def require_same_grid(block: Replay, setups: Sequence[Setup]) -> None:
    """Raise SetupError where a change asks for another grid."""
    for setup in setups:
        if setup.element_size != block.setup.element_size:
            told = "a grid of other elements is no small change of this one; take differences of whole replays"
            raise SetupError(told, key="element_size", value=setup.element_size)


def _holds(block: Replay, frame: Equilibrium) -> bool:
    """Whether anything deforms the block at all."""
    return bool(frame.in_contact or block.setup.load.specific_weight_over_stiffness)


def require_history_free(*setups: Setup) -> None:
    """Raise SetupError where a frame hangs on those before it."""
    told = "a frame that hangs on those before it has no first-order changes of its own; ask for those of the whole replay"
    for setup in setups:
        require_memoryless(setup.material, f"{told}, or")
        if setup.has_history:
            raise SetupError(told, key="friction_coefficient")


def _unbalanced(
    block: Replay, frame: Equilibrium, model: BlockModel, changes: Sequence[Change]
) -> tuple[FloatArray, FloatArray]:
    """At the frame's displacement, minus the changes of the residual (u, len(changes)) and of the
    tool's push (3, len(changes)).

    Both over E [m^2]. A tool that gives way stays where it is here; `CompliantTool` moves it.
    """
    positions, here = frame.mesh.nodes + frame.displacement, local_tool(frame)
    state = model.assemble(positions, here, tangent=False)
    right, eased = np.zeros((len(state.residual), len(changes))), np.zeros((3, len(changes)))
    for column, (setup, move) in enumerate(changes):
        same = same_body(block, setup)
        shift = np.zeros(3) if is_compliant(block.setup, setup) else _shift(block, setup, move)
        if (
            same and setup.tool.radius == block.setup.tool.radius and not shift.any()
        ):  # only the sensor differs
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


def same_body(block: Replay, setup: Setup) -> bool:
    """Whether the setup differs from the block's in the tool, the sensor and the modulus at most,
    which all else is over.
    """
    here = block.setup
    material = replace(setup.material, young_modulus=here.material.young_modulus)
    parts = ("load", "support", "geometry")
    return material == here.material and all(
        getattr(setup, part) == getattr(here, part) for part in parts
    )


def mesh_in(block: Replay, setup: Setup, frame: Equilibrium) -> Mesh:
    """The frame's mesh, in the setup's block where that has another size."""
    if setup.geometry == block.setup.geometry or not isinstance(frame.mesh, BoxMesh):
        return frame.mesh
    return frame.mesh.scaled(np.array(setup.box.size) / np.array(block.setup.box.size))


def _shift(block: Replay, setup: Setup, move: FloatArray) -> FloatArray:
    """How the tool's centre moves before it gives way (3,) [m]."""
    return np.asarray(np.array(setup.tool.offset) - np.array(block.setup.tool.offset) + move)


def is_compliant(*setups: Setup) -> bool:
    """Whether the tool gives way in any of them."""
    return any(setup.tool.compliance_times_stiffness for setup in setups)


def tool_derivatives(
    model: BlockModel, positions: FloatArray, tool: ToolSphere
) -> tuple[FloatArray, FloatArray]:
    """Of the residual (u, 3) and of minus the force on the tool (3, 3), both over E, by the tool's
    motion [m].
    """
    residuals, forces = np.empty((int(model.topology.free.sum()), 3)), np.empty((3, 3))
    for column, axis in enumerate(np.eye(3)):
        ways = [
            ToolSphere(tool.centre + sign * _SLOPE_STEP * axis, tool.radius) for sign in (1, -1)
        ]
        ahead, behind = (model.assemble(positions, way, tangent=False) for way in ways)
        residuals[:, column] = (ahead.residual - behind.residual) / (2 * _SLOPE_STEP)
        forces[:, column] = (ahead.push - behind.push) / (2 * _SLOPE_STEP)
    return residuals, forces


class CompliantTool:
    """How a tool on a spring takes part in a change, at a frame whose tangent is factorised; changes without one move nothing here.

    With y its centre, s its stated one, c its compliance times E and f the force on it over E, y = s + c f. So, with B the change
    of the residual and -H that of f as y moves, A = K^-1 B and `free` the change of the displacement at a fixed tool,

        (1 + c (H - B' A)) dy = ds + dc f + c (df - B' free),    du = free - A dy.

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
        """The change of the displacement (u, len(changes)) [m], by that at a fixed tool; for a
        symmetric tangent.
        """
        driven = self.driven(changes) - self._compliance * (self.coupling.T @ free)
        return np.asarray(free - self.answer @ (self._inverse @ driven))

    def driven(self, changes: Sequence[Change]) -> FloatArray:
        """ds + dc f + c df (3, len(changes)) [m]."""
        found = np.zeros((3, len(changes)))
        for column, (setup, move) in enumerate(changes):
            if not is_compliant(self._block.setup, setup):
                continue
            softer = setup.tool.compliance_times_stiffness - self._compliance
            found[:, column] = (
                _shift(self._block, setup, move)
                + softer * self._force
                + self._compliance * self._pushed(setup)
            )
        return found

    def _pushed(self, setup: Setup) -> FloatArray:
        """Change of the force on the tool (3,) over E with another radius or surface, the
        displacement staying as it is.
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


@on_one_thread
def displacement_changes(
    block: Replay, frame: Equilibrium, changes: Sequence[Change], *, exact: bool = True
) -> FloatArray:
    """Displacements that small changes bring about, to first order.

    Args:
        block: what made the frame.
        frame: an equilibrium in contact, or under its own weight.
        changes: (setup, move) pairs: a Setup that differs a little from the block's, and how the
            tool's stated centre moves with it (3,) [m]. The base may not change between held and
            free to move; where it has slid, it stays.
        exact: or with five digits, in half the time.

    Returns:
        (len(changes), n, 3) changes of the nodes' displacement from where they are at rest [m];
        zero where nothing holds the tool against the block.
    """
    require_history_free(block.setup, *(setup for setup, _ in changes))
    require_same_grid(block, [setup for setup, _ in changes])
    result = np.zeros((len(changes), *frame.displacement.shape))
    model = factorise_at(block, frame) if _holds(block, frame) else None
    if model is None or not changes:
        return result
    factor, right = model.topology.factor, _unbalanced(block, frame, model, changes)[0]
    free = factor.solve(right) if exact else factor.approximate(right)
    if is_compliant(block.setup, *(setup for setup, _ in changes)):
        free = CompliantTool(block, frame, model).moved(changes, free)
    result[:, model.topology.free] = free.T
    return result


def force_changes(
    block: Replay, frame: Equilibrium, changes: Sequence[Change], displacements: FloatArray
) -> FloatArray:
    """How the force on the tool changes (len(changes), 3) [N], to first order.

    With B the change of the residual as the tool moves, that of the force on it by the displacement
    is -B': both are of one energy.

    Args:
        displacements: (len(changes), n, 3) what these changes bring about, as from
            `displacement_changes` [m].
    """
    require_history_free(block.setup, *(setup for setup, _ in changes))
    found = np.zeros((len(changes), 3))
    if not frame.in_contact or not changes:
        return found
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
    found = (
        _unbalanced(block, frame, model, changes)[1].T
        - displacements[:, model.topology.free] @ coupling
    )
    for number, (setup, move) in enumerate(changes):
        if is_compliant(block.setup, setup):
            # The tool's own way is ds + dc f + c df, as `CompliantTool` has it, and pushes it by H of
            # that.
            giving = block.setup.tool.compliance_times_stiffness
            driven = (
                _shift(block, setup, move)
                + (setup.tool.compliance_times_stiffness - giving) * frame.force / modulus
            )
            found[number] = np.linalg.solve(
                np.eye(3) + giving * harder, found[number] - harder @ driven
            )
        found[number] += (setup.material.young_modulus / modulus - 1) * frame.force / modulus
    return found * modulus
