"""How a frame's displacement changes with anything in the Setup: one extra solve on a factor that is there already.

At equilibrium the residual R(u, p) vanishes, so du/dp = -K^-1 dR/dp (implicit function theorem). dR/dp is taken by asking the
changed Setup for its residual at the same displacement; thus any effect has its sensitivity without knowing the solver.
A setup that remembers has none here: its frame hangs on all those before it, which a change would have changed, too.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from core.errors import SetupError
from core.fem.elastic import assemble_elastic
from core.fem.factor import NotPositiveDefinite
from core.fem.model import BlockModel, Probe
from core.frames import FloatArray
from core.memory import refuse_memory
from core.replay import Equilibrium, Replay
from core.setup import Setup

__all__ = ["TOOL_STEP", "displacement_changes", "factorise_at", "loss_changes", "stiffness_changes"]

TOOL_STEP = 5e-7
"""Motion of the tool [m] over which residuals are differenced: so short that no further surface point comes into touch."""


def factorise_at(block: Replay, frame: Equilibrium) -> BlockModel | None:
    """Factorise the tangent at a frame's equilibrium; None when it has no Cholesky factor."""
    block.dense = frame.dense
    model = block.model(frame.mesh)
    model.harden(frame.hardness)
    model.expect(frame.mesh.nodes + frame.displacement, (_local(frame),))
    state = model.assemble(frame.mesh.nodes + frame.displacement, _local(frame))
    try:
        model.topology.factor.factorise(state.data)
    except NotPositiveDefinite:
        return None
    return model


def _local(frame: Equilibrium) -> Probe:
    """The tool as the slid block sees it."""
    return Probe(frame.probe.centre - np.append(frame.slip, 0.0), frame.probe.radius)


def _holds(block: Replay, frame: Equilibrium) -> bool:
    """Whether anything deforms the block at all."""
    return bool(frame.in_contact or block.setup.load.specific_weight_over_stiffness)


def _memoryless(*setups: Setup) -> None:
    """Raise SetupError where a frame hangs on those before it."""
    told = "a frame that hangs on those before it has no first-order changes of its own; take differences of whole replays"
    for setup in setups:
        refuse_memory(setup.material, f"{told}, or")
        if setup.remembers:
            raise SetupError(told, key="friction_coefficient")


def _unbalanced(block: Replay, frame: Equilibrium, model: BlockModel, changes: Sequence[tuple[Setup, FloatArray]]) -> FloatArray:
    """Minus the change of the residual (u, len(changes)) over E [m^2] at the frame's displacement.

    A tool that gives way stays where it is here; `_GivingTool` moves it.
    """
    positions, here = frame.mesh.nodes + frame.displacement, _local(frame)
    residual = model.assemble(positions, here, tangent=False).residual
    right = np.zeros((len(residual), len(changes)))
    for column, (setup, move) in enumerate(changes):
        same = _same_body(block, setup)
        shift = np.zeros(3) if _gives(block.setup, setup) else _shift(block, setup, move)
        if same and setup.tool.radius == block.setup.tool.radius and not shift.any():  # only the sensor differs
            continue
        other = model if same else BlockModel(setup, frame.mesh, dense=frame.dense)
        other.harden(frame.hardness)
        other.expect(positions, (here,))
        probe = Probe(here.centre + shift, here.radius + setup.tool.radius - block.setup.tool.radius)
        right[:, column] = residual - other.assemble(positions, probe, tangent=False).residual
    return right


def _same_body(block: Replay, setup: Setup) -> bool:
    here = block.setup
    return setup.material == here.material and setup.load == here.load and setup.support == here.support


def _shift(block: Replay, setup: Setup, move: FloatArray) -> FloatArray:
    """How the tool's centre moves before it gives way (3,) [m]."""
    return np.asarray(np.array(setup.tool.offset) - np.array(block.setup.tool.offset) + move)


def _gives(*setups: Setup) -> bool:
    return any(setup.tool.compliance_times_stiffness for setup in setups)


class _GivingTool:
    """How a tool on a spring takes part in a change, at a frame whose tangent is factorised; changes without one move nothing here.

    With y its centre, s its stated one, c its compliance times E and f the force on it over E, y = s + c f. So, with B the change
    of the residual and -H that of f as y moves, A = K^-1 B and `free` the change of the displacement at a fixed tool,

        (1 + c (H - B' A)) dy = ds + dc f + c (df - B' free),    du = free - A dy.
    """

    def __init__(self, block: Replay, frame: Equilibrium, model: BlockModel) -> None:
        self._block, self._model, self._here = block, model, _local(frame)
        self._positions = frame.mesh.nodes + frame.displacement
        self._compliance = block.setup.tool.compliance_times_stiffness
        state = model.assemble(self._positions, self._here, tangent=False)
        self._force = -state.push
        slopes = [self._slope(axis) for axis in np.eye(3)]
        self._coupling = np.stack([residual for residual, _ in slopes], axis=1)
        harder = -np.stack([force for _, force in slopes], axis=1)
        self.answer = model.topology.factor.solve(self._coupling)
        self._inverse = np.linalg.inv(np.eye(3) + self._compliance * (harder - self._coupling.T @ self.answer))

    def _slope(self, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of the residual (u,) and of the force on the tool (3,), over E, by the tool's motion along an axis [m]."""
        ways = [Probe(self._here.centre + sign * TOOL_STEP * axis, self._here.radius) for sign in (1, -1)]
        ahead, behind = (self._model.assemble(self._positions, probe, tangent=False) for probe in ways)
        return (ahead.residual - behind.residual) / (2 * TOOL_STEP), (behind.push - ahead.push) / (2 * TOOL_STEP)

    def coupled(self, free: FloatArray) -> FloatArray:
        """B' free (3, m) [m^2]."""
        return np.asarray(self._coupling.T @ free)

    def moves(self, changes: Sequence[tuple[Setup, FloatArray]], coupled: FloatArray) -> FloatArray:
        """Of the centre (3, len(changes)) [m], with B' free of each change as `coupled` (3, len(changes)) [m^2]."""
        right = np.zeros_like(coupled)
        for column, (setup, move) in enumerate(changes):
            if not _gives(self._block.setup, setup):
                continue
            softer, pushed = setup.tool.compliance_times_stiffness - self._compliance, self._pushed(setup) - coupled[:, column]
            right[:, column] = _shift(self._block, setup, move) + softer * self._force + self._compliance * pushed
        return np.asarray(self._inverse @ right)

    def _pushed(self, setup: Setup) -> FloatArray:
        """Change of the force on the tool (3,) over E with another radius, all else staying where it is."""
        wider = setup.tool.radius - self._block.setup.tool.radius
        if not wider:
            return np.zeros(3)
        state = self._model.assemble(self._positions, Probe(self._here.centre, self._here.radius + wider), tangent=False)
        return np.asarray(-state.push - self._force)


def displacement_changes(block: Replay, frame: Equilibrium, changes: Sequence[tuple[Setup, FloatArray]]) -> FloatArray:
    """Displacements that small changes bring about, to first order.

    Args:
        block: what made the frame. frame: an equilibrium in contact, or under its own weight.
        changes: (setup, move) pairs: a Setup that differs a little from the block's, and how the tool's stated centre
            moves with it (3,) [m]. The base may not change between held and free to move.

    Returns:
        (len(changes), n, 3) changes of the nodes' displacement [m]; zero where nothing holds the tool against the block.
    """
    _memoryless(block.setup, *(setup for setup, _ in changes))
    result = np.zeros((len(changes), *frame.displacement.shape))
    model = factorise_at(block, frame) if _holds(block, frame) else None
    if model is None or not changes:
        return result
    free = model.topology.factor.solve(_unbalanced(block, frame, model, changes))
    if _gives(block.setup, *(setup for setup, _ in changes)):
        tool = _GivingTool(block, frame, model)
        free -= tool.answer @ tool.moves(changes, tool.coupled(free))
    result[:, model.topology.free] = free.T
    return result


def loss_changes(block: Replay, frame: Equilibrium, slope: FloatArray, changes: Sequence[tuple[Setup, FloatArray]]) -> FloatArray:
    """How a function of the displacement changes, to first order, by the adjoint: one solve for any number of changes.

    With K the (symmetric) tangent and K lambda = dL/du, the change is dL = -lambda . dR (e.g. Plessix 2006).

    Args:
        block, frame, changes: as for `displacement_changes`. slope: (n, 3) derivative of the function by the displacement [1/m].

    Returns:
        (len(changes),) changes of the function; zero where nothing holds the tool against the block.
    """
    _memoryless(block.setup, *(setup for setup, _ in changes))
    model = factorise_at(block, frame) if _holds(block, frame) else None
    if model is None or not changes:
        return np.zeros(len(changes))
    right = _unbalanced(block, frame, model, changes)
    adjoint = model.topology.factor.solve(slope[model.topology.free])
    found = np.asarray(adjoint @ right)
    if _gives(block.setup, *(setup for setup, _ in changes)):
        tool = _GivingTool(block, frame, model)
        found -= slope[model.topology.free] @ tool.answer @ tool.moves(changes, tool.answer.T @ right)
    return found


def stiffness_changes(block: Replay, frame: Equilibrium, log_factors: FloatArray) -> FloatArray:
    """Displacements that small changes of the stiffness within the body bring about, to first order.

    Args:
        log_factors: (m, e, q) logarithm of new over old stiffness, at the quadrature points of the frame's mesh.

    Returns:
        (m, n, 3) [m]; cheap in m, since a point's share of the residual is what it alone would resist with.
    """
    _memoryless(block.setup)
    result = np.zeros((len(log_factors), *frame.displacement.shape))
    model = factorise_at(block, frame) if frame.in_contact else None
    if model is None:
        return result
    forces = point_forces(model, frame.mesh.nodes + frame.displacement)
    elements, points = model.mu.shape
    unknown = np.repeat(model.topology.unknown[model.topology.elements].reshape(elements, 1, -1), points, axis=1)
    used = unknown >= 0
    column = np.broadcast_to(np.arange(elements * points).reshape(elements, points, 1), unknown.shape)
    shape = (int(model.topology.unknown.max()) + 1, elements * points)
    gather = sp.csr_matrix((forces.reshape(unknown.shape)[used], (unknown[used], column[used])), shape=shape)
    right = gather @ sp.csc_matrix(log_factors.reshape(len(log_factors), -1).T)
    free = -model.topology.factor.solve(right.toarray())
    if _gives(block.setup):
        tool = _GivingTool(block, frame, model)
        free -= tool.answer @ tool.moves([(block.setup, np.zeros(3))] * len(log_factors), tool.coupled(free))
    result[:, model.topology.free] = free.T
    return result


def point_forces(model: BlockModel, positions: FloatArray) -> FloatArray:
    """Internal forces over E that the stiffness at each quadrature point puts on its element's nodes (e, q, a, 3) [m^2].

    Forces are linear in the stiffness, so each point's are those of a body that has none elsewhere.
    """
    elements, points = model.mu.shape
    corners = model.topology.elements.shape[1]
    apart = np.arange(corners * elements).reshape(elements, corners)
    where = positions[model.topology.elements].reshape(-1, 3)
    forces = np.empty((elements, points, corners, 3))
    for point in range(points):
        mu, bulk, force = np.zeros_like(model.mu), np.zeros_like(model.bulk), np.zeros((corners * elements, 3))
        mu[:, point], bulk[:, point] = model.mu[:, point], model.bulk[:, point]
        assemble_elastic(model.law, model.rule, apart, mu, bulk, where, np.empty((0, 0, 0), np.int32), force, np.empty(0))
        forces[:, point] = force.reshape(elements, corners, 3)
    return forces
