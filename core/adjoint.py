"""Gradients through a replay whose frames hang on those before them: by the adjoint, backwards, one solve per frame.

With R(u_n, h_n-1, p) = 0 the equilibrium of frame n and h_n = H(u_n, h_n-1, p) what its material remembers then, a function L of
all displacements has (discrete adjoint, e.g. Michaleris, Tortorelli and Vidal 1994), from the last frame to the first,

    (dR/du)' lambda_n = dL/du_n + (dH/du)' eta_n,    eta_n-1 = (dH/dh)' eta_n - (dR/dh)' lambda_n,
    dL = sum over n of eta_n . dH - lambda_n . dR

with dR and dH what a changed Setup makes of R and H at the same displacement and history, as in `core.sensitivity`. The first of
the frames is the block at rest. With friction at the tool h has the ways from the anchors, too, and where the surface was seen from
the tool; with a base that slides, how far it has; and all equilibria on the way to a frame count as frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from core.drag_adjoint import Begun, DragStep
from core.errors import SetupError, SolveError
from core.fem.drag import Past, hold_of, renewed
from core.fem.factor import NotPositiveDefinite
from core.fem.model import BlockModel, Probe
from core.fem.transposed import TransposedTangent
from core.frames import FloatArray
from core.instants import Instant, instants_of, tool_shifts
from core.memory import History, Memory
from core.memory_adjoint import MemoryStep, added, nothing
from core.replay import Equilibrium, Replay
from core.sensitivity import GivingTool, gives, local_probe, mesh_in, refuse_other_grid, same_body, tool_slopes
from core.setup import Setup
from core.slide_adjoint import SlideStep
from core.threads import on_one_thread

__all__ = ["replay_loss_changes"]


def _positions(frame: Equilibrium) -> FloatArray:
    return frame.mesh.nodes + frame.displacement


@dataclass(frozen=True, eq=False)
class _Found:
    """What a setup makes of an instant's displacements: residual (u,) over E [m^2], the force on the tool (3,) [N], what is
    remembered then, and the ways that friction leaves (m, 3) [m]; None without memory or friction."""

    residual: FloatArray
    force: FloatArray
    history: History | None
    ways: FloatArray | None


class _Body:
    """A setup's block, put back to any instant."""

    def __init__(self, block: Replay, setup: Setup) -> None:
        self.block, self.setup, self.memory = block, setup, Memory.of(setup, block.grid, block.free.mesh)

    def begin(self, instant: Instant) -> BlockModel:
        """The model in the step that leads there."""
        frame, memory = instant.frame, self.memory
        model = BlockModel(self.setup, mesh_in(self.block, self.setup, frame), dense=frame.dense)
        model.harden(frame.hardness)
        model.expect(model.mesh.nodes + frame.displacement, (local_probe(frame),))
        if memory is not None and instant.past is not None:
            memory.history = instant.past
            if instant.time is None:
                memory.rest()
            else:
                memory.begin(instant.time)
            memory.recall(model, _positions(instant.frame))
        return model

    def find(self, instant: Instant, probe: Probe, past: Past | None) -> _Found:
        """With the tool here, and with friction with this beginning of the step."""
        model = self.begin(instant)
        positions = model.mesh.nodes + instant.frame.displacement
        if past is not None:
            model.grip = renewed(model, positions, probe, past, self.setup.tool.friction_coefficient)
        ways = None if model.grip is None else hold_of(model, positions, probe, model.grip).ways
        history = self.memory.after(instant.frame) if self.memory is not None and instant.last else None
        state = model.assemble(positions, probe, tangent=False)
        return _Found(state.residual, -state.push * self.setup.material.young_modulus, history, ways)


def _check(block: Replay, frames: Sequence[Equilibrium], setups: Sequence[Setup]) -> None:
    """Raise SetupError for what this does not go through."""
    material, tool = block.setup.material, block.setup.tool
    refuse_other_grid(block, setups)
    for setup in (block.setup, *setups):
        if setup.tool.friction_coefficient and not tool.friction_coefficient:
            raise SetupError("a change adds friction that the block does not have; give it a little", key="friction_coefficient")
        if setup.tool.friction_coefficient and setup.tool.compliance_times_stiffness:
            told = "a tool that gives way and drags the surface has no gradients by the adjoint; take differences of whole replays"
            raise SetupError(told, key="compliance_times_stiffness")
        if len(setup.material.relaxation) != len(material.relaxation):
            raise SetupError("a change adds a term of relaxation; give the block one, of fraction 0", key="relaxation")
        if setup.material.retained_fraction and not material.retained_fraction:
            raise SetupError("a change adds a set that the block has not kept; give it a small one", key="retained_fraction")
    if block.setup.remembers and any(setup.geometry != block.setup.geometry for setup in setups):
        told = "a block that changes its size while it remembers has no gradients by the adjoint; take differences of whole replays"
        raise SetupError(told, key="geometry")
    if any(frame.slip.any() for frame in frames):
        _check_slid([block.setup, *setups])


def _check_slid(setups: Sequence[Setup]) -> None:
    """The same, where the base slid."""
    if any(setup.support.friction_coefficient is None for setup in setups):
        raise SetupError("a change holds a base that slid; change its friction only a little", key="friction_coefficient")
    for key in ("friction_coefficient", "compliance_times_stiffness"):
        if any(getattr(setup.tool, key) for setup in setups):
            told = f"a base that slid under a tool with a {key} has no gradients by the adjoint; take differences of whole replays"
            raise SetupError(told, key=key)


def _shifts(block: Replay, instants: Sequence[Instant], setup: Setup, moves: FloatArray) -> tuple[FloatArray, FloatArray]:
    """As `tool_shifts` has them, by a change of the setup and of the stated centres (f, 3) [m]."""
    here, other = block.setup.tool, setup.tool
    moved = moves + np.array(other.offset) - np.array(here.offset)
    return tool_shifts(block, instants, moved, other.radius - here.radius)


@dataclass(frozen=True, eq=False)
class _Parts:
    """What an instant leaves to the next, linearised, as far as there is any; `past` is where its step with friction began."""

    instant: Instant
    past: Past | None
    drag: DragStep | None
    memory: MemoryStep | None
    slide: SlideStep | None

    @property
    def slope(self) -> FloatArray:
        """Of all that by the displacements (n, 3)."""
        parts = [part for part in (self.drag, self.memory, self.slide) if part is not None]
        return sum((part.slope for part in parts), np.zeros_like(self.instant.frame.displacement))

    def agreement(self, found: _Found, setup: Setup) -> float:
        """The costates times what another setup leaves beyond this one."""
        total = 0.0
        if self.memory is not None and found.history is not None:
            total += self.memory.agreement(found.history)
        if self.drag is not None and found.ways is not None:
            total += self.drag.agreement(found.ways)
        if self.slide is not None:
            total += self.slide.agreement(found.force, setup)
        return total


class _Backwards:
    """The pass from the last frame to the rest; `total` (c,) is what each change does to the function so far."""

    def __init__(self, block: Replay, instants: Sequence[Instant], changes: Sequence[tuple[Setup, FloatArray]]) -> None:
        self._block, self._changes, self._body = block, changes, _Body(block, block.setup)
        self._others = [_Body(block, setup) for setup, _ in changes]
        self._shifts = [_shifts(block, instants, setup, moves) for setup, moves in changes]
        memory = self._body.memory
        self._costate = None if memory is None else nothing(memory.history)
        self._begun: Begun | None = None
        self._slides = any(instant.frame.slip.any() for instant in instants)
        self._slip, self._instants = np.zeros(2), instants
        self.total = np.zeros(len(changes))

    def step(self, index: int, slope: FloatArray) -> None:
        """Through one instant, of whose positions the function has this slope (n, 3) [1/m]."""
        instant, begun = self._instants[index], self._begun
        start, model = self._instants[max(index - 1, 0)].frame, self._body.begin(instant)
        past, drag = self._drag(instant, model, start)
        sides = tool_slopes(model, _positions(instant.frame), local_probe(instant.frame)) if self._slides else None
        parts = _Parts(instant, past, drag, self._memory(instant, model), self._slide(index, model, sides))
        whole = slope + parts.slope + (0.0 if begun is None else begun.displacement)
        tangent = self._tangent(parts, model)
        free = self._balance(instant, model, tangent, whole)
        self._change(index, parts, free)
        if sides is not None:
            self._slip = self._slip + slope.sum(axis=0)[:2] + (free @ sides[0])[:2]
            self._slip -= 0.0 if parts.slide is None else parts.slide.centre[:2]
        self._go_back(index, parts, start, tangent.field(free))

    def _tangent(self, parts: _Parts, model: BlockModel) -> TransposedTangent:
        """Of an instant's equilibrium."""
        frame, beside = (
            parts.instant.frame,
            [part for part in (parts.drag, parts.memory) if part is not None and not part.symmetric],
        )
        try:
            return TransposedTangent(model, _positions(frame), local_probe(frame), beside)
        except NotPositiveDefinite:
            told = f"frame {parts.instant.number}: the tangent has no factor there, so the gradient is without bounds"
            raise SolveError(told, frame=parts.instant.number) from None

    def _go_back(self, index: int, parts: _Parts, start: Equilibrium, adjoint: FloatArray) -> None:
        """From the costates after an instant to those before it, by its adjoint displacement (n, 3)."""
        if parts.memory is not None and self._costate is not None:
            past = parts.memory.before(adjoint)
            self._costate = past if parts.instant.last else added(self._costate, past)
        self._begun = None if parts.drag is None else parts.drag.before(start, adjoint)
        if self._begun is not None:
            self.total += np.array([before[index] for _, before in self._shifts]) @ self._begun.centre

    def _slide(self, index: int, model: BlockModel, sides: tuple[FloatArray, FloatArray] | None) -> SlideStep | None:
        """How the base slides on from an instant to the next."""
        instant = self._instants[index]
        if sides is None or instant.last or (self._instants[index + 1].frame.slip == instant.frame.slip).all():
            return None
        return SlideStep(instant.frame, self._block.setup, self._slip, sides, model.topology.free)

    def _drag(self, instant: Instant, model: BlockModel, start: Equilibrium) -> tuple[Past | None, DragStep | None]:
        """The step's beginning and the step itself, where friction left anything; the model is given its grip."""
        frame, here = instant.frame, local_probe(instant.frame)
        if frame.hold is None:
            return None, None
        past = Past.of(model, start, self._block.from_where(start, here))
        costate = np.zeros_like(frame.hold.ways) if self._begun is None else self._begun.ways
        drag = DragStep(model, _positions(frame), here, past, self._block.setup.tool.friction_coefficient, costate)
        model.grip = drag.grip
        return past, drag

    def _memory(self, instant: Instant, model: BlockModel) -> MemoryStep | None:
        """The step of the memory; on the way to a frame nothing is remembered yet."""
        memory, costate = self._body.memory, self._costate
        if memory is None or costate is None:
            return None
        if not instant.last:
            costate = nothing(costate)
        elif instant.number is None:  # nothing is delayed after a long rest
            costate = replace(costate, delayed=np.zeros_like(costate.delayed))
        return MemoryStep(memory, model, instant.frame, costate)

    def _balance(self, instant: Instant, model: BlockModel, tangent: TransposedTangent, slope: FloatArray) -> FloatArray:
        """The adjoint displacement (u,); adds what a tool that gives way brings about by its spring."""
        adjoint = tangent.solve(slope[model.topology.free])
        if not instant.frame.in_contact or not gives(self._block.setup, *(setup for setup, _ in self._changes)):
            return adjoint
        tool = GivingTool(self._block, instant.frame, model, tangent.solve)
        adjoint, place = tool.adjoint(adjoint)
        moves = [(setup, moves[instant.number or 0]) for setup, moves in self._changes]
        self.total += place @ tool.driven(moves)
        return adjoint

    def _change(self, index: int, parts: _Parts, adjoint: FloatArray) -> None:
        """Add what the changed setups make of the equilibrium and of what it leaves to the next."""
        setup, instant = self._block.setup, parts.instant
        here = local_probe(instant.frame)
        base = self._body.find(instant, here, parts.past)
        for number, (other, (shifts, _)) in enumerate(zip(self._others, self._shifts, strict=True)):
            shift = np.zeros(3) if gives(setup, other.setup) else shifts[index]
            if same_body(self._block, other.setup) and other.setup.tool == setup.tool and not shift.any():
                continue  # only the sensor differs
            probe = Probe(here.centre + shift, here.radius + other.setup.tool.radius - setup.tool.radius)
            found = other.find(instant, probe, parts.past)
            self.total[number] += parts.agreement(found, other.setup) - float(adjoint @ (found.residual - base.residual))


@on_one_thread
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
            passed over. slopes: (n, 3) derivatives of the function by where each frame's nodes are, slid or not [1/m]. times: (f,)
            of the frames [s], which a material with memory asks for.
        changes: (setup, moves) pairs: a Setup that differs a little from the block's, and how the tool's stated centres move with
            it, (3,) or (f, 3) [m]. What only another path through the frames would tell is refused: SetupError.

    Returns:
        (len(changes),) changes of the function.
    """
    _check(block, frames, [setup for setup, _ in changes])
    spread = [(setup, np.broadcast_to(moves, (len(frames), 3))) for setup, moves in changes]
    when = None if times is None else np.asarray(times, dtype=float).tolist()
    instants = instants_of(block, Memory.of(block.setup, block.grid, block.free.mesh), frames, when)
    way = _Backwards(block, instants, spread)
    for index in reversed(range(len(instants))):
        instant = instants[index]
        known = instant.number is not None and instant.last
        slope = slopes[instant.number or 0] if known else np.zeros_like(instant.frame.displacement)
        way.step(index, slope)
    return way.total
