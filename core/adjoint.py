"""Gradients through a replay whose frames hang on those before them: by the adjoint, backwards, one solve per frame.

With R(u_n, h_n-1, p) = 0 the equilibrium of frame n and h_n = H(u_n, h_n-1, p) what its material remembers then, a function L of
all displacements has (discrete adjoint, e.g. Michaleris, Tortorelli and Vidal 1994), from the last frame to the first,

    (dR/du)' lambda_n = dL/du_n + (dH/du)' eta_n,    eta_n-1 = (dH/dh)' eta_n - (dR/dh)' lambda_n,
    dL = sum over n of eta_n . dH - lambda_n . dR

with dR and dH what a changed Setup makes of R and H at the same displacement and history, as in `core.sensitivity`. The first of
the frames is the block at rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse.linalg import LinearOperator, gmres

from core.errors import SetupError, SolveError
from core.fem.factor import NotPositiveDefinite
from core.fem.model import BlockModel
from core.fem.newton import Outcome
from core.frames import FloatArray
from core.memory import History, Memory
from core.memory_adjoint import MemoryStep, agreement, nothing
from core.meshing import Mesh
from core.replay import Equilibrium, Replay
from core.sensitivity import GivingTool, gives, local_probe, same_body, unbalanced
from core.setup import Setup

__all__ = ["replay_loss_changes"]

_TOLERANCE, _MOST_TURNS = 1e-11, 200


@dataclass(frozen=True, eq=False)
class _Instant:
    """A frame on the way, the rest's first: its time [s], None for the rest, what was remembered before it, and its number."""

    frame: Equilibrium
    time: float | None
    past: History | None
    number: int | None


class _Body:
    """What a setup's block remembers, put back to any frame."""

    def __init__(self, block: Replay, setup: Setup) -> None:
        mesh = block.free.mesh
        self.setup, self.memory = setup, Memory.of(setup, block.grid, mesh)

    def begin(self, instant: _Instant, mesh: Mesh) -> BlockModel:
        """The model in the step that leads to a frame."""
        model, memory = BlockModel(self.setup, mesh), self.memory
        if memory is not None and instant.past is not None:
            memory.history = instant.past
            if instant.time is None:
                memory.rest()
            else:
                memory.begin(instant.time)
            memory.recall(model, instant.frame.mesh.nodes + instant.frame.displacement)
        return model


def _instants(block: Replay, body: _Body, frames: Sequence[Equilibrium], times: Sequence[float] | None) -> list[_Instant]:
    """The rest and all frames that are equilibria; those that are none are not remembered."""
    memory = body.memory
    found = [_Instant(block.free, None, None if memory is None else memory.history, None)]
    if memory is not None:
        memory.start(block.free)
    for number, frame in enumerate(frames):
        if frame.outcome is Outcome.CONVERGED:
            time = None if times is None else times[number]
            found.append(_Instant(frame, time, None if memory is None else memory.history, number))
            if memory is not None:
                memory.begin(time)
                memory.end(frame)
    return found


def _check(block: Replay, frames: Sequence[Equilibrium], setups: Sequence[Setup]) -> None:
    """Raise SetupError for what this does not go through."""
    material = block.setup.material
    for setup in (block.setup, *setups):
        if setup.tool.friction_coefficient:
            told = "friction at the tool has no gradients by the adjoint; take differences of whole replays"
            raise SetupError(told, key="friction_coefficient")
        if len(setup.material.relaxation) != len(material.relaxation):
            raise SetupError("a change adds a term of relaxation; give the block one, of fraction 0", key="relaxation")
        if setup.material.retained_fraction and not material.retained_fraction:
            raise SetupError("a change adds a set that the block has not kept; give it a small one", key="retained_fraction")
    if any(frame.slip.any() for frame in frames):
        told = "a base that slid has no gradients by the adjoint; take differences of whole replays"
        raise SetupError(told, key="friction_coefficient")


def _factorise(model: BlockModel, instant: _Instant) -> None:
    frame = instant.frame
    model.harden(frame.hardness)
    state = model.assemble(frame.mesh.nodes + frame.displacement, local_probe(frame))
    try:
        model.topology.factor.factorise(state.data)
    except NotPositiveDefinite:
        raise SolveError(
            f"frame {instant.number}: the tangent has no factor there, so the gradient is without bounds", frame=instant.number
        ) from None


class _Tangent:
    """The transposed tangent of a frame: the model's factor, and what the growth of a set adds to it."""

    def __init__(self, model: BlockModel, step: MemoryStep | None) -> None:
        self._model, self._step = model, step

    def field(self, free: FloatArray) -> FloatArray:
        """Unknowns (u,) at the nodes (n, 3)."""
        found = np.zeros(self._model.topology.free.shape)
        found[self._model.topology.free] = free
        return found

    def _turned(self, free: FloatArray) -> FloatArray:
        """Times the tangent, divided by its symmetric part."""
        assert self._step is not None
        top = self._model.topology
        return free + top.factor.solve(self._step.tangent(self.field(free))[top.free])

    def solve(self, right: FloatArray) -> FloatArray:
        """For one (u,) or several (u, m) right sides."""
        near = self._model.topology.factor.solve(right)
        if self._step is None or not self._step.grows:
            return near
        if right.ndim == 2:
            return np.stack([self.solve(column) for column in right.T], axis=1)
        operator = LinearOperator((len(right), len(right)), matvec=self._turned, dtype=float)
        found, missed = gmres(operator, near, x0=near, rtol=_TOLERANCE, atol=0.0, restart=50, maxiter=_MOST_TURNS)
        if missed:
            raise SolveError("the adjoint of a frame in which a set grows was not found")
        return np.asarray(found)


class _Backwards:
    """The pass from the last frame to the rest; `total` (c,) is what each change does to the function so far."""

    def __init__(self, block: Replay, body: _Body, changes: Sequence[tuple[Setup, FloatArray]]) -> None:
        self._block, self._body, self._changes = block, body, changes
        self._others = [_Body(block, setup) for setup, _ in changes]
        self._gives = gives(block.setup, *(setup for setup, _ in changes))
        self._costate = None if body.memory is None else nothing(body.memory.history)
        self.total = np.zeros(len(changes))

    def step(self, instant: _Instant, slope: FloatArray) -> None:
        """Through one frame, of which the function has this slope (n, 3) [1/m]."""
        frame, memory, costate = instant.frame, self._body.memory, self._costate
        model = self._body.begin(instant, frame.mesh)
        linear = None if memory is None else MemoryStep(memory, model, frame)
        if linear is not None and costate is not None:
            if instant.time is None:  # nothing is delayed after a long rest
                costate = replace(costate, delayed=np.zeros_like(costate.delayed))
            slope = slope + linear.slope(costate)
        _factorise(model, instant)
        tangent = _Tangent(model, linear)
        adjoint = self._balance(instant, model, tangent, slope)
        if memory is not None and linear is not None and costate is not None:
            self._remember(instant, costate, memory.after(frame))
            self._costate = linear.before(costate, adjoint)

    def _balance(self, instant: _Instant, model: BlockModel, tangent: _Tangent, slope: FloatArray) -> FloatArray:
        """Add what the changes of the equilibrium bring about; returns the adjoint displacement (n, 3)."""
        frame = instant.frame
        still = instant.number is None
        changes = [(setup, np.zeros(3) if still else moves[instant.number]) for setup, moves in self._changes]
        adjoint = tangent.solve(slope[model.topology.free])
        if self._gives and frame.in_contact:
            tool = GivingTool(self._block, frame, model, tangent.solve)
            adjoint, place = tool.adjoint(adjoint)
            self.total += place @ tool.driven(changes)
        right = unbalanced(self._block, frame, model, changes, lambda number: self._others[number].begin(instant, frame.mesh))
        self.total += adjoint @ right
        return tangent.field(adjoint)

    def _remember(self, instant: _Instant, costate: History, after: History) -> None:
        """Add what the changes of the memory bring about."""
        for number, other in enumerate(self._others):
            if same_body(self._block, other.setup) or other.memory is None:
                continue
            other.begin(instant, instant.frame.mesh)
            self.total[number] += agreement(costate, other.memory.after(instant.frame), after)


def replay_loss_changes(
    block: Replay,
    frames: Sequence[Equilibrium],
    slopes: Sequence[FloatArray],
    changes: Sequence[tuple[Setup, FloatArray]],
    times: ArrayLike | None = None,
) -> FloatArray:
    """How a function of all displacements of a replay changes, to first order.

    Args:
        block: a Replay of the setup and grid of the frames. frames: all of a replay from rest; those without equilibrium count as
            passed over. slopes: (n, 3) derivatives of the function by each frame's displacement [1/m]. times: (f,) of the frames
            [s], which a material with memory asks for.
        changes: (setup, moves) pairs: a Setup that differs a little from the block's, and how the tool's stated centres move with
            it, (3,) or (f, 3) [m]. What only another path through the frames would tell is refused: SetupError.

    Returns:
        (len(changes),) changes of the function.
    """
    _check(block, frames, [setup for setup, _ in changes])
    spread = [(setup, np.broadcast_to(moves, (len(frames), 3))) for setup, moves in changes]
    body = _Body(block, block.setup)
    instants = _instants(block, body, frames, None if times is None else np.asarray(times, dtype=float).tolist())
    way = _Backwards(block, body, spread)
    for instant in reversed(instants):
        way.step(instant, np.zeros_like(instant.frame.displacement) if instant.number is None else slopes[instant.number])
    return way.total
