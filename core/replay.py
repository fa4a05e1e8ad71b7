"""Replay a tool's motion: one converged equilibrium per frame, or a sentence saying why not.

The block keeps no memory, except in a material that does (`core.memory`), and for a sliding base, whose place depends on the pushes
before. A graded mesh follows the tool: each frame has its own node coordinates, and starts from the frame before, interpolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from core.equilibrium import Equilibrium, require_converged
from core.errors import SetupError, SolveError
from core.fem.drag import Past, drag
from core.fem.follow import Follower
from core.fem.model import BlockModel, Probe
from core.fem.newton import RELATIVE_TOLERANCE, Outcome, Solution, solve
from core.fem.path import FREE_STEP, lead
from core.frames import FloatArray
from core.memory import Memory, State
from core.meshing import Mesh, Meshing
from core.progress import Report, silent
from core.setup import Setup
from core.yielding import GRAVITY, give_way, slide, weight_of

__all__ = ["GRAVITY", "Equilibrium", "Replay", "replay", "require_converged", "rest"]

_MOST_SLIDES, _DRAG_STEP, _HALVINGS = 12, 1e-3, 40
"""Of a base in one frame; longest straight motion of a tool with friction [m]; of the way to the first touch, down to rounding."""


class Replay:
    """A block that is led through the tool's positions one after another.

    Args:
        setup: what is believed. grid: the mesh. tolerance: residual at which a frame counts as converged, over the push.
    """

    def __init__(self, setup: Setup, grid: Meshing, tolerance: float = RELATIVE_TOLERANCE) -> None:
        self.setup, self.grid, self.tolerance = setup, grid, tolerance
        self._offset, self._follower = np.array(setup.tool.offset), Follower()
        self._model: BlockModel | None = None
        self._before: tuple[Equilibrium, Equilibrium] | None = None
        self.slip = np.zeros(2)
        self._rest_mesh = grid.mesh(setup, np.array([0.0, 0.0, setup.geometry.height]))
        self.memory = Memory.of(setup, grid, self._rest_mesh)
        if self.memory is not None:
            self.memory.start(self.free)

    def state(self, frame: Equilibrium) -> State:
        """What another replay of the same setup and grid can go on from: `frame` is the last one."""
        return State(frame, None if self.memory is None else self.memory.history)

    def resume(self, state: State) -> None:
        """Go on from there: `step` from the state's frame."""
        self.slip = state.frame.slip.copy()
        if self.memory is not None and state.history is not None:
            self.memory.history = state.history

    def model(self, mesh: Mesh) -> BlockModel:
        """The block's potential on this mesh, in the step in time that is under way; the last one is kept."""
        if self._model is None or self._model.mesh is not mesh:
            self._model = BlockModel(self.setup, mesh)
        if self.memory is not None:
            self.memory.recall(self._model)
        return self._model

    @cached_property
    def free(self) -> Equilibrium:
        """The block without the tool: sagging under gravity, otherwise as stated."""
        mesh, away = self._rest_mesh, Probe(np.array([0.0, 0.0, 10.0]), self.setup.tool.radius)
        if not self.setup.load.specific_weight_over_stiffness:
            still = np.zeros_like(mesh.nodes)
            return Equilibrium(mesh, still, np.zeros(2), away, np.zeros(3), Outcome.CONVERGED, 0, 0.0, 0.0, False)
        return self._equilibrium(self._untouched(self.model(mesh), mesh.nodes), mesh, away)

    def _untouched(self, model: BlockModel, positions: FloatArray) -> Solution:
        """Equilibrium without the tool, from positions (n, 3) [m]."""
        return self._settled(model, None, solve(model, None, positions, None, self.tolerance))

    def _settled(self, model: BlockModel, probe: Probe | None, solution: Solution) -> Solution:
        """The solution with the set that it leaves in a material that keeps one."""
        return solution if self.memory is None else self.memory.settled(model, probe, solution, self.tolerance, self._follower)

    def _equilibrium(self, solution: Solution, mesh: Mesh, probe: Probe) -> Equilibrium:
        force = -solution.push * self.setup.material.young_modulus
        touched = bool(np.linalg.norm(solution.push) > 0)
        displacement = solution.positions - mesh.nodes
        return Equilibrium(
            mesh, displacement, self.slip.copy(), probe, force, solution.outcome, solution.iterations, solution.residual,
            solution.penetration, touched, hardness=self.model(mesh).hardness,
        )  # fmt: skip

    def away(self, probe: Probe) -> bool:
        """Whether the tool cannot touch the block, sagging and bulging allowed for."""
        slack = 5e-4 if self.setup.load.specific_weight_over_stiffness or self.setup.material.remembers else 0.0
        nearest = self.setup.geometry.nearest(probe.centre[None])[0]
        return bool(np.linalg.norm(probe.centre - nearest) > probe.radius + slack)

    def held(self, probe: Probe, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the base where it is; `probe` in the frame of the slid block."""
        local = Probe(probe.centre - np.append(self.slip, 0.0), probe.radius)
        if self.away(local):
            if self.memory is None or self.memory.fresh:
                return replace(self.free, slip=self.slip.copy(), probe=probe)
            # The grid stays where the dent is.
            solution = self._untouched(self.model(start.mesh), start.mesh.nodes + start.displacement)
            return self._equilibrium(solution, start.mesh, probe)
        model, positions, before, carried = self.set_out(local, start)
        positions = self._extrapolated(model, start, positions, local)
        if self.setup.tool.friction_coefficient:
            past = Past.of(model, start, Probe(before.centre - carried, before.radius))
            frame = self._dragged(model, positions, (before, local), past, probe)
        else:
            solution = lead(model, positions, before, local, self.tolerance, self._follower)
            frame = self._equilibrium(self._settled(model, local, solution), model.mesh, probe)
        self._before = (start, frame)
        return frame

    def set_out(self, probe: Probe, start: Equilibrium) -> tuple[BlockModel, FloatArray, Probe, FloatArray]:
        """Where a solve begins, seen from the slid block: the model, positions (n, 3) [m], the tool before `probe`, and how far the
        grid's focus has moved since `start` (3,) [m], which carries the dent along with the tool.
        """
        mesh = self.grid.mesh(self.setup, probe.centre)
        model, displacement = self.model(mesh), start.displacement
        carried = mesh.focus - start.mesh.focus if start.in_contact else np.zeros(3)
        if start.mesh is not mesh:
            displacement = start.mesh.interpolate(start.displacement, mesh.nodes - carried)
            displacement[mesh.connectivity.base_nodes] *= 1.0 if model.sprung else 0.0
        before = self.from_where(start, probe)
        return model, mesh.nodes + displacement, Probe(before.centre + carried, before.radius), carried

    def from_where(self, start: Equilibrium, probe: Probe) -> Probe:
        """Where the way from a frame to `probe` (seen from the slid block) begins: from afar, where it is about to touch."""
        before = Probe(start.probe.centre - np.append(start.slip, 0.0), start.probe.radius)
        return before if start.in_contact else self._first_touch(before, probe)

    def _dragged(
        self, model: BlockModel, positions: FloatArray, probes: tuple[Probe, Probe], past: Past, probe: Probe
    ) -> Equilibrium:
        """Equilibrium with friction under the tool, whose `probes` before and now are in the frame of the slid block."""
        friction = self.setup.tool.friction_coefficient
        recall = None if self.memory is None else self.memory.recall
        solution, hold = drag(model, positions, probes, past, friction, self.tolerance, self._follower, recall)
        return replace(self._equilibrium(solution, model.mesh, probe), hold=hold)

    def _led(self, probe: Probe, start: Equilibrium) -> Equilibrium:
        """Equilibrium at `probe`; with friction by way of places so near that each point's way between two is known."""
        if not self.setup.tool.friction_coefficient:
            return self.held(probe, start)
        slip = np.append(self.slip, 0.0)
        begin = self.from_where(start, Probe(probe.centre - slip, probe.radius)).centre + slip
        steps = max(1, int(np.ceil(float(np.linalg.norm(probe.centre - begin)) / _DRAG_STEP)))
        way = [start]
        for share in np.arange(1, steps + 1) / steps:
            way.append(self.held(Probe(begin + share * (probe.centre - begin), probe.radius), way[-1]))
            if way[-1].outcome is not Outcome.CONVERGED:
                break
        return self._after(way[1:-1], way[-1])

    def _after(self, way: Sequence[Equilibrium], frame: Equilibrium) -> Equilibrium:
        """A frame with what was on the way to it."""
        found = replace(frame, way=tuple(way))
        if self._before is not None and self._before[1] is frame:
            self._before = (self._before[0], found)
        return found

    def _extrapolated(self, model: BlockModel, start: Equilibrium, positions: FloatArray, probe: Probe) -> FloatArray:
        """Where the last two frames point to, if that lies lower in energy than the last frame itself."""
        if self._before is None or self._before[1] is not start:
            return positions
        earlier = self._before[0]
        if not (earlier.in_contact and earlier.mesh is start.mesh is model.mesh):
            return positions
        here = start.probe.centre - np.append(start.slip, 0.0)
        last, now = here - (earlier.probe.centre - np.append(earlier.slip, 0.0)), probe.centre - here
        if not last.any() or max(np.linalg.norm(last), np.linalg.norm(now)) > FREE_STEP:
            return positions
        share = float(now @ last / (last @ last))
        guess = positions + min(max(share, -1.0), 1.5) * (start.displacement - earlier.displacement)
        return guess if model.energy(guess, probe) < model.energy(positions, probe) else positions

    def _first_touch(self, before: Probe, probe: Probe) -> Probe:
        """The last place on the way to `probe` that is clear of the block."""
        low, high = 0.0, 1.0
        if np.linalg.norm(before.centre - probe.centre) > 1.0 or not self.away(before):
            middle = (self.setup.geometry.low + self.setup.geometry.high) / 2
            before = Probe(probe.centre + (probe.centre - middle) / np.linalg.norm(probe.centre - middle) * 0.05, probe.radius)
        for _ in range(_HALVINGS):
            share = (low + high) / 2
            clear = self.away(Probe(before.centre + share * (probe.centre - before.centre), probe.radius))
            low, high = (share, high) if clear else (low, share)
        return Probe(before.centre + low * (probe.centre - before.centre), probe.radius)

    def step(self, stated_centre: FloatArray, start: Equilibrium | None = None, time: float | None = None) -> Equilibrium:
        """Equilibrium with the tool at a stated centre (3,) [m], phantom frame; tool and base give way if they can.

        A material with memory must be told the time [s], and goes on from its last equilibrium, whatever the start.
        """
        centre, start = stated_centre + self._offset, self.free if start is None else start
        if self.memory is not None:
            self.memory.begin(time)
        if self.setup.tool.compliance_times_stiffness:
            frame = give_way(centre, start, self.setup, self.tolerance, self._placed)
        else:
            frame = self._placed(centre, start)
        if self.memory is not None:
            self.memory.end(frame)
        return frame

    def on_finer_grid(self, stated_centre: FloatArray, start: Equilibrium | None, failed: Equilibrium) -> Equilibrium:
        """The frame once more, on a grid 1.5 times finer; as it was, where that finds no equilibrium, either.

        A ball pressed in by more than its radius can slip behind the chords of a coarse grid's surface, and not of a fine one's.
        """
        other = Replay(self.setup, self.grid.finer(), self.tolerance)
        for begin in (start,) if self.setup.remembers else (start, None):
            other.slip = self.slip.copy() if begin is None else begin.slip.copy()
            frame = other.step(stated_centre, begin)
            if frame.outcome is Outcome.CONVERGED:
                self.slip = other.slip
                return frame
        return failed

    def _placed(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the tool's centre held here (3,) [m]; slides the base if it cannot hold."""
        probe = Probe(centre, self.setup.tool.radius)
        frame = self._led(probe, start)
        if self.setup.support.friction_coefficient is None:
            return frame
        return self._slide(probe, frame, self.setup.support.friction_coefficient)

    def _slide(self, probe: Probe, frame: Equilibrium, friction: float) -> Equilibrium:
        """Move the base until friction holds: Coulomb, with the weight and the push as its load."""
        weight, way = weight_of(self.setup), [frame]
        for _ in range(_MOST_SLIDES):
            step = slide(way[-1], friction, weight)
            if step is None or way[-1].outcome is not Outcome.CONVERGED:
                break
            self.slip = self.slip + step
            way.append(self.held(probe, way[-1]))
        before = [*frame.way, replace(frame, way=()), *way[1:]]
        return self._after(before[:-1], way[-1])


def rest(setup: Setup, grid: Meshing) -> Equilibrium:
    """The block without the tool."""
    return Replay(setup, grid).free


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
        setup: what is believed. centres: (f, 3) stated tool centres [m], phantom frame, in the order of time.
        grid: the mesh. times: (f,) of the frames [s], which a material with memory asks for. since: where an earlier replay ended
            (`Replay.state`), to go on from; else from rest. starts: equilibria of a similar setup at the same frames to begin from;
            else from the frame before. tolerance: residual at which a frame counts as converged, over the push. report: progress.

    A frame that finds no equilibrium is tried on a finer grid. One that finds none there, either, is returned with its outcome,
    never raised: look at `outcome`, or call `require_converged`.
    """
    if starts is not None and setup.remembers:
        raise SolveError("a setup whose frames depend on those before them is replayed in order of time, without starts")
    block, frames = Replay(setup, grid, tolerance), []
    previous: Equilibrium | None = None
    if since is not None:
        block.resume(since)
        previous = since.frame
    instants = [None] * len(centres) if times is None else np.asarray(times, dtype=float).tolist()
    if len(instants) != len(centres):
        raise SetupError(f"{len(instants)} times for {len(centres)} frames; give one for each", key="times")
    for number, (centre, time) in enumerate(zip(np.asarray(centres, dtype=float), instants, strict=True)):
        report(number / len(centres), f"frame {number + 1} of {len(centres)}")
        start = starts[number] if starts is not None and starts[number].in_contact else previous
        frame = block.step(centre, start, time)
        # A long jump may lead through the block; from rest the tool comes in from outside, and what friction held is forgotten.
        for other in () if setup.tool.friction_coefficient else (previous, None):
            if frame.outcome is not Outcome.CONVERGED and other is not start:
                start, frame = other, block.step(centre, other, time)
        if frame.outcome is not Outcome.CONVERGED and not setup.material.remembers:  # what it remembers is not on that grid
            frame = block.on_finer_grid(centre, previous, frame)
        frames.append(frame)
        previous = frame if frame.outcome is Outcome.CONVERGED else previous if setup.remembers else None
    return frames
