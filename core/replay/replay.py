"""Replay a tool's motion: one converged equilibrium per frame, or a sentence saying why not.

The block keeps no memory, except in a material that does (`palpate.replay.material_history`), and
for a sliding base, whose place depends on the pushes before. A graded mesh follows the tool: each
frame has its own node coordinates, and starts from the frame before, interpolated.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from palpate.fem.continuation import first_touch, lead
from palpate.fem.model import BlockModel, Probe
from palpate.fem.modified_newton import Follower
from palpate.fem.newton import RELATIVE_TOLERANCE, Outcome, Solution, blocked, solve
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError, SolveError
from palpate.foundation.progress import Report, silent
from palpate.foundation.threads import on_one_thread
from palpate.mesh.box_mesh import meshing_for
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.compliance_and_slip import GRAVITY, give_way, slide, weight_of
from palpate.replay.equilibrium import Equilibrium, extrapolated, require_converged, taught
from palpate.replay.friction_step import Past, drag
from palpate.replay.material_history import Memory, State
from palpate.setup.setup import Setup

__all__ = ["GRAVITY", "Equilibrium", "Replay", "replay", "require_converged", "rest"]

_MOST_SLIDES, _DRAG_STEP = 40, 1e-3
"""Of a base in one frame; of a tool with friction, unless another `drag_step` is asked for [m]."""


class Replay:
    """A block that is led through the tool's positions one after another.

    Args:
        setup: what is believed.
        grid: the mesh, unless the setup has one.
        tolerance: residual of a converged frame, over the push.
        drag_step: longest motion of a tool with friction [m] that is taken as straight.

    Attributes:
        factorised: the frame of which a model holds the factor, and the factor's number
            (`palpate.gradients.forward.factorise_at`).
    """

    def __init__(
        self,
        setup: Setup,
        grid: Meshing,
        tolerance: float = RELATIVE_TOLERANCE,
        drag_step: float = _DRAG_STEP,
    ) -> None:
        self.setup, self.grid, self.tolerance, self._drag_step = (
            setup,
            meshing_for(setup, grid),
            tolerance,
            drag_step,
        )
        self._offset, self._follower = np.array(setup.tool.offset), Follower()
        self._model: BlockModel | None = None
        self._mesh: Mesh | None = None
        self._before: tuple[Equilibrium, Equilibrium] | None = None
        self._hard = False  # whether some frame was lost by the quick solver: from then on each teaches the next (`taught`)
        self.factorised: tuple[Equilibrium, BlockModel, int] | None = None
        self.slip, self.dense = np.zeros(2), False
        self._rest_mesh = self.grid.mesh(setup, np.array([0.0, 0.0, setup.geometry.height]))
        self.memory = Memory.of(setup, self.grid, self._rest_mesh)
        if self.memory is not None:
            self.memory.start(self.free)

    def state(self, frame: Equilibrium) -> State:
        """What another replay of the same setup and grid can go on from: `frame` is the last
        one."""
        return State(frame, None if self.memory is None else self.memory.history)

    def resume(self, state: State) -> None:
        """Go on from there: `step` from the state's frame."""
        self.slip = state.frame.slip.copy()
        if self.memory is not None and state.history is not None:
            self.memory.history = state.history

    def model(self, mesh: Mesh) -> BlockModel:
        """The block's potential on this mesh, in the step in time that is under way; the last one
        is kept.
        """
        if self._model is None or self._model.mesh is not mesh or self._model.dense != self.dense:
            self._model = BlockModel(self.setup, mesh, dense=self.dense)
        if self.memory is not None:
            self.memory.recall(self._model)
        return self._model

    @cached_property
    def free(self) -> Equilibrium:
        """The block without the tool: sagging under gravity, otherwise as stated."""
        mesh, away = self._rest_mesh, Probe(np.array([0.0, 0.0, 10.0]), self.setup.tool.radius)
        if not self.setup.load.specific_weight_over_stiffness:
            still = np.zeros_like(mesh.nodes)
            return Equilibrium(
                mesh, still, np.zeros(2), away, np.zeros(3), Outcome.CONVERGED, 0, 0.0, 0.0, False
            )
        return self._equilibrium(self._untouched(self.model(mesh), mesh.nodes), mesh, away)

    def _untouched(self, model: BlockModel, positions: FloatArray) -> Solution:
        """Equilibrium without the tool, from positions (n, 3) [m]."""
        return self._settled(model, None, solve(model, None, positions, None, self.tolerance))

    def _settled(self, model: BlockModel, probe: Probe | None, solution: Solution) -> Solution:
        """The solution with the set that it leaves in a material that keeps one."""
        return (
            solution
            if self.memory is None
            else self.memory.settled(model, probe, solution, self.tolerance, self._follower)
        )

    def _equilibrium(self, solution: Solution, mesh: Mesh, probe: Probe) -> Equilibrium:
        force = -solution.push * self.setup.material.young_modulus
        touched = bool(np.linalg.norm(solution.push) > 0)
        displacement = solution.positions - mesh.nodes
        return Equilibrium(
            mesh,
            displacement,
            self.slip.copy(),
            probe,
            force,
            solution.outcome,
            solution.iterations,
            solution.residual,
            solution.penetration,
            touched,
            hardness=self.model(mesh).hardness,
            dense=self.dense,
        )

    def away(self, probe: Probe) -> bool:
        """Whether the tool cannot touch the block, sagging and bulging allowed for."""
        slack = (
            5e-4
            if self.setup.load.specific_weight_over_stiffness or self.setup.material.remembers
            else 0.0
        )
        nearest = self.setup.geometry.nearest(probe.centre[None])[0]
        return bool(np.linalg.norm(probe.centre - nearest) > probe.radius + slack)

    def held(self, probe: Probe, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the base where it is; `probe` in the frame of the slid block."""
        local = Probe(probe.centre - np.append(self.slip, 0.0), probe.radius)
        if self.away(local):
            if self.memory is None or self.memory.fresh:
                return replace(self.free, slip=self.slip.copy(), probe=probe)
            # The grid stays where the dent is.
            solution = self._untouched(
                self.model(start.mesh), start.mesh.nodes + start.displacement
            )
            return self._equilibrium(solution, start.mesh, probe)
        frame = self._touched(probe, local, start)
        if frame.outcome not in (Outcome.CONVERGED, Outcome.BASE_IN_TOOL) and not self.dense:
            # Most likely the tool slipped in between the points at which the surface feels it, from
            # which no care would keep it.
            self.dense = True
            frame = self._touched(probe, local, start)
        self._before = (start, frame)
        return frame

    def _touched(self, probe: Probe, local: Probe, start: Equilibrium) -> Equilibrium:
        """Equilibrium under the tool, which is at `local` in the frame of the slid block."""
        model, positions, before, carried = self.set_out(local, start)
        model.expect(positions, (before, local))
        if (failed := blocked(model, positions, local)) is not None:
            return self._equilibrium(failed, model.mesh, probe)
        if self._before is not None and self._before[1] is start:
            positions = extrapolated(model, (self._before[0], start), positions, local)
        elif self._before is not None and self._hard:
            positions = taught(model, self._before, start, positions, local)
        if self.setup.tool.friction_coefficient:
            past = Past.of(model, start, Probe(before.centre - carried, before.radius))
            return self._dragged(model, positions, (before, local), past, probe)
        solution = lead(
            model, positions, before, local, self.tolerance, self._follower, haste=not self.dense
        )
        self._hard = self._hard or self._follower.failing
        return self._equilibrium(self._settled(model, local, solution), model.mesh, probe)

    def set_out(
        self, probe: Probe, start: Equilibrium
    ) -> tuple[BlockModel, FloatArray, Probe, FloatArray]:
        """Where a solve begins, seen from the slid block: the model, positions (n, 3) [m], the tool
        before `probe`, and how far the grid's focus has moved since `start` (3,) [m], which carries
        the dent along with the tool.
        """
        mesh = self._mesh or self.grid.mesh(self.setup, probe.centre)
        model, displacement = self.model(mesh), start.displacement
        carried = mesh.focus - start.mesh.focus if start.in_contact else np.zeros(3)
        if start.mesh is not mesh:
            displacement = start.mesh.interpolate(start.displacement, mesh.nodes - carried)
            displacement[mesh.connectivity.base_nodes] *= 1.0 if model.sprung else 0.0
        before = self.from_where(start, probe)
        return (
            model,
            mesh.nodes + displacement,
            Probe(before.centre + carried, before.radius),
            carried,
        )

    def from_where(self, start: Equilibrium, probe: Probe) -> Probe:
        """Where the way from a frame to `probe` (seen from the slid block) begins: from afar, where
        it is about to touch.
        """
        before = Probe(start.probe.centre - np.append(start.slip, 0.0), start.probe.radius)
        return (
            before
            if start.in_contact
            else first_touch(before, probe, self.setup.geometry, self.away)
        )

    def _dragged(
        self,
        model: BlockModel,
        positions: FloatArray,
        probes: tuple[Probe, Probe],
        past: Past,
        probe: Probe,
    ) -> Equilibrium:
        """Equilibrium with friction under the tool, whose `probes` before and now are in the frame
        of the slid block.
        """
        friction = self.setup.tool.friction_coefficient
        recall = None if self.memory is None else self.memory.recall
        solution, hold = drag(
            model, positions, probes, past, friction, self.tolerance, self._follower, recall
        )
        return replace(self._equilibrium(solution, model.mesh, probe), hold=hold)

    def _led(self, probe: Probe, start: Equilibrium) -> Equilibrium:
        """Equilibrium at `probe`; with friction by way of places so near that each point's way
        between two is known.
        """
        if not self.setup.tool.friction_coefficient:
            return self.held(probe, start)
        slip = np.append(self.slip, 0.0)
        begin = self.from_where(start, Probe(probe.centre - slip, probe.radius)).centre + slip
        steps = max(1, int(np.ceil(float(np.linalg.norm(probe.centre - begin)) / self._drag_step)))
        way = [start]
        for share in np.arange(1, steps + 1) / steps:
            way.append(
                self.held(Probe(begin + share * (probe.centre - begin), probe.radius), way[-1])
            )
            if way[-1].outcome is not Outcome.CONVERGED:
                break
        return self._after(way[1:-1], way[-1])

    def _after(self, way: Sequence[Equilibrium], frame: Equilibrium) -> Equilibrium:
        """A frame with what was on the way to it."""
        found = replace(frame, way=tuple(way))
        if self._before is not None and self._before[1] is frame:
            self._before = (self._before[0], found)
        return found

    @on_one_thread
    def step(
        self, stated_centre: FloatArray, start: Equilibrium | None = None, time: float | None = None
    ) -> Equilibrium:
        """Equilibrium with the tool at a stated centre (3,) [m], phantom frame; tool and base give
        way if they can.

        A material with memory must be told the time [s], and goes on from its last equilibrium,
        whatever the start.
        """
        centre, start = stated_centre + self._offset, self.free if start is None else start
        self.dense = start.dense and start.in_contact
        if self.memory is not None:
            self.memory.begin(time)
        slip, frame = self.slip, self._balanced(centre, start)
        if frame.outcome is not Outcome.CONVERGED and self.setup.tool.compliance_times_stiffness:
            # Of several solves some may have let the tool slip in between the points that feel it;
            # and where one grid gives way to another, which resists otherwise, a tool on a spring
            # may find its balance on neither.
            self.slip, self.dense = slip, True
            self._mesh = frame.mesh if frame.outcome is Outcome.TOOL_SWINGS else None
            frame = self._balanced(centre, start)
            self._mesh = None
        if frame.outcome is not Outcome.CONVERGED:
            self.slip = slip
        if self.memory is not None:
            self.memory.end(frame)
        return frame

    def sought(
        self, centre: FloatArray, starts: Iterable[Equilibrium | None], time: float | None = None
    ) -> Equilibrium:
        """As `step`, from the first of these frames from which it finds an equilibrium, or from
        rest; else as the last one left it.

        A long jump may lead through the block; from rest the tool comes in from outside, and what
        friction held would be forgotten.
        """
        rest = () if self.setup.tool.friction_coefficient else (None,)
        for start in dict.fromkeys((*starts, *rest)):
            frame = self.step(centre, start, time)
            if frame.outcome is Outcome.CONVERGED:
                break
        return frame

    def _balanced(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the tool, or the other end of the spring on which it gives way, at
        `centre` (3,) [m].
        """
        if self.setup.tool.compliance_times_stiffness:
            return give_way(centre, start, self.setup, self.tolerance, self._placed)
        return self._placed(centre, start)

    def _placed(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the tool's centre held here (3,) [m]; slides the base if it cannot
        hold."""
        probe = Probe(centre, self.setup.tool.radius)
        frame, friction = self._led(probe, start), self.setup.support.friction_coefficient
        return frame if friction is None else self._slide(probe, frame, friction)

    def _slide(self, probe: Probe, frame: Equilibrium, friction: float) -> Equilibrium:
        """Move the base until friction holds: Coulomb, with the weight and the push as its load."""
        weight, way = weight_of(self.setup), [frame]
        for _ in range(_MOST_SLIDES):
            step = slide(way[-1], friction, weight)
            if step is None or way[-1].outcome is not Outcome.CONVERGED:
                break
            self.slip = self.slip + step
            way.append(self.held(probe, way[-1]))
        else:
            way[-1] = replace(way[-1], outcome=Outcome.BASE_SLIDES)
        return self._after([*frame.way, replace(frame, way=()), *way[1:]][:-1], way[-1])


def rest(setup: Setup, grid: Meshing) -> Equilibrium:
    """The block without the tool."""
    return Replay(setup, grid).free


@on_one_thread
def replay(
    setup: Setup,
    centres: FloatArray,
    grid: Meshing,
    *,
    times: ArrayLike | None = None,
    since: State | None = None,
    starts: Sequence[Equilibrium] | None = None,
    tolerance: float = RELATIVE_TOLERANCE,
    report: Report = silent,
) -> list[Equilibrium]:
    """One equilibrium per frame.

    Args:
        setup: what is believed.
        centres: (f, 3) stated tool centres [m], phantom frame, in the order of time.
        grid: the mesh.
        times: (f,) of the frames [s], which a material with memory asks for.
        since: where an earlier replay ended (`Replay.state`), to go on from; else from rest.
        starts: equilibria of a similar setup at the same frames to begin from; else from the frame
            before.
        tolerance: residual at which a frame counts as converged, over the push.
        report: progress.

    A frame that finds no equilibrium is returned with its outcome, never raised: look at `outcome`,
    or call `require_converged`.
    """
    if starts is not None and setup.remembers:
        raise SolveError(
            "a setup whose frames depend on those before them is replayed in order of time, without starts"
        )
    block, frames = Replay(setup, grid, tolerance), []
    previous = None if since is None else since.frame
    if since is not None:
        block.resume(since)
    instants = [None] * len(centres) if times is None else np.asarray(times, dtype=float).tolist()
    if len(instants) != len(centres):
        raise SetupError(
            f"{len(instants)} times for {len(centres)} frames; give one for each", key="times"
        )
    for number, (centre, time) in enumerate(
        zip(np.asarray(centres, dtype=float), instants, strict=True)
    ):
        report(number / len(centres), f"frame {number + 1} of {len(centres)}")
        start = starts[number] if starts is not None and starts[number].in_contact else previous
        frame = block.sought(centre, (start, previous), time)
        frames.append(frame)
        previous = (
            frame if frame.outcome is Outcome.CONVERGED else previous if setup.remembers else None
        )
    return frames
