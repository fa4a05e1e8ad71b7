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

from palpate.fem.continuation import first_touch, move_tool
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import RELATIVE_TOLERANCE, Outcome, Solution, blocked_by_base, solve
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError, SolveError
from palpate.foundation.progress import Report, silent
from palpate.foundation.threads import on_one_thread
from palpate.mesh.box_mesh import meshing_for
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.compliance_and_slip import GRAVITY, slip_step, solve_compliant_tool, weight_of
from palpate.replay.equilibrium import (
    Equilibrium,
    extrapolated,
    predict_from_similar,
    require_converged,
)
from palpate.replay.friction_step import FrictionState, solve_with_friction
from palpate.replay.material_history import MaterialHistory, ReplayState
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
            (`palpate.gradients.frame_tangent.factorise_at`).
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
        self._offset, self._quick_solver = np.array(setup.tool.offset), ModifiedNewton()
        self._model: BlockModel | None = None
        self._mesh: Mesh | None = None
        self._before: tuple[Equilibrium, Equilibrium] | None = None
        self._use_similar = False  # whether some frame was lost by the quick solver: from then on each teaches the next (`predict_from_similar`)
        self.factorised: tuple[Equilibrium, BlockModel, int] | None = None
        self.slip, self.dense = np.zeros(2), False
        self._rest_mesh = self.grid.mesh(setup, np.array([0.0, 0.0, setup.geometry.height]))
        self.material_history = MaterialHistory.of(setup, self.grid, self._rest_mesh)
        if self.material_history is not None:
            self.material_history.start(self.free)

    def state(self, frame: Equilibrium) -> ReplayState:
        """What another replay of the same setup and grid can go on from: `frame` is the last
        one."""
        return ReplayState(
            frame, None if self.material_history is None else self.material_history.history
        )

    def resume(self, state: ReplayState) -> None:
        """Go on from there: `step` from the state's frame."""
        self.slip = state.frame.slip.copy()
        if self.material_history is not None and state.history is not None:
            self.material_history.history = state.history

    def model(self, mesh: Mesh) -> BlockModel:
        """The block's potential on this mesh, in the step in time that is under way; the last one
        is kept.
        """
        if self._model is None or self._model.mesh is not mesh or self._model.dense != self.dense:
            self._model = BlockModel(self.setup, mesh, dense=self.dense)
        if self.material_history is not None:
            self.material_history.apply_to(self._model)
        return self._model

    @cached_property
    def free(self) -> Equilibrium:
        """The block without the tool: sagging under gravity, otherwise as stated."""
        mesh, away = self._rest_mesh, ToolSphere(np.array([0.0, 0.0, 10.0]), self.setup.tool.radius)
        if not self.setup.load.specific_weight_over_stiffness:
            still = np.zeros_like(mesh.nodes)
            return Equilibrium(
                mesh, still, np.zeros(2), away, np.zeros(3), Outcome.CONVERGED, 0, 0.0, 0.0, False
            )
        return self._equilibrium(self._solve_without_tool(self.model(mesh), mesh.nodes), mesh, away)

    def _solve_without_tool(self, model: BlockModel, positions: FloatArray) -> Solution:
        """Equilibrium without the tool, from positions (n, 3) [m]."""
        return self._with_permanent_set(
            model, None, solve(model, None, positions, None, self.tolerance)
        )

    def _with_permanent_set(
        self, model: BlockModel, tool: ToolSphere | None, solution: Solution
    ) -> Solution:
        """The solution with the set that it leaves in a material that keeps one."""
        return (
            solution
            if self.material_history is None
            else self.material_history.with_permanent_set(
                model, tool, solution, self.tolerance, self._quick_solver
            )
        )

    def _equilibrium(self, solution: Solution, mesh: Mesh, tool: ToolSphere) -> Equilibrium:
        force = -solution.push * self.setup.material.young_modulus
        touched = bool(np.linalg.norm(solution.push) > 0)
        displacement = solution.positions - mesh.nodes
        return Equilibrium(
            mesh,
            displacement,
            self.slip.copy(),
            tool,
            force,
            solution.outcome,
            solution.iterations,
            solution.residual,
            solution.penetration,
            touched,
            hardness=self.model(mesh).hardness,
            dense=self.dense,
        )

    def is_clear(self, tool: ToolSphere) -> bool:
        """Whether the tool cannot touch the block, sagging and bulging allowed for."""
        slack = (
            5e-4
            if self.setup.load.specific_weight_over_stiffness or self.setup.material.has_history
            else 0.0
        )
        nearest = self.setup.geometry.nearest(tool.centre[None])[0]
        return bool(np.linalg.norm(tool.centre - nearest) > tool.radius + slack)

    def solve_with_fixed_base(self, tool: ToolSphere, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the base where it is; `tool` in the frame of the slid block."""
        local = ToolSphere(tool.centre - np.append(self.slip, 0.0), tool.radius)
        if self.is_clear(local):
            if self.material_history is None or self.material_history.fresh:
                return replace(self.free, slip=self.slip.copy(), tool=tool)
            # The grid stays where the dent is.
            solution = self._solve_without_tool(
                self.model(start.mesh), start.mesh.nodes + start.displacement
            )
            return self._equilibrium(solution, start.mesh, tool)
        frame = self._solve_contact(tool, local, start)
        if frame.outcome not in (Outcome.CONVERGED, Outcome.BASE_IN_TOOL) and not self.dense:
            # Most likely the tool slipped in between the points at which the surface feels it, from
            # which no care would keep it.
            self.dense = True
            frame = self._solve_contact(tool, local, start)
        self._before = (start, frame)
        return frame

    def _solve_contact(
        self, tool: ToolSphere, local: ToolSphere, start: Equilibrium
    ) -> Equilibrium:
        """Equilibrium under the tool, which is at `local` in the frame of the slid block."""
        model, positions, before, carried = self.initial_state(local, start)
        model.restrict_to_facing(positions, (before, local))
        if (failed := blocked_by_base(model, positions, local)) is not None:
            return self._equilibrium(failed, model.mesh, tool)
        if self._before is not None and self._before[1] is start:
            positions = extrapolated(model, (self._before[0], start), positions, local)
        elif self._before is not None and self._use_similar:
            positions = predict_from_similar(model, self._before, start, positions, local)
        if self.setup.tool.friction_coefficient:
            past = FrictionState.of(
                model, start, ToolSphere(before.centre - carried, before.radius)
            )
            return self._solve_with_friction(model, positions, (before, local), past, tool)
        solution = move_tool(
            model,
            positions,
            before,
            local,
            self.tolerance,
            self._quick_solver,
            haste=not self.dense,
        )
        self._use_similar = self._use_similar or self._quick_solver.failing
        return self._equilibrium(self._with_permanent_set(model, local, solution), model.mesh, tool)

    def initial_state(
        self, tool: ToolSphere, start: Equilibrium
    ) -> tuple[BlockModel, FloatArray, ToolSphere, FloatArray]:
        """Where a solve begins, seen from the slid block: the model, positions (n, 3) [m], the tool
        before `tool`, and how far the grid's focus has moved since `start` (3,) [m], which carries
        the dent along with the tool.
        """
        mesh = self._mesh or self.grid.mesh(self.setup, tool.centre)
        model, displacement = self.model(mesh), start.displacement
        carried = mesh.focus - start.mesh.focus if start.in_contact else np.zeros(3)
        if start.mesh is not mesh:
            displacement = start.mesh.interpolate(start.displacement, mesh.nodes - carried)
            displacement[mesh.connectivity.base_nodes] *= 1.0 if model.sprung else 0.0
        before = self.approach_start(start, tool)
        return (
            model,
            mesh.nodes + displacement,
            ToolSphere(before.centre + carried, before.radius),
            carried,
        )

    def approach_start(self, start: Equilibrium, tool: ToolSphere) -> ToolSphere:
        """Where the way from a frame to `tool` (seen from the slid block) begins: from afar, where
        it is about to touch.
        """
        before = ToolSphere(start.tool.centre - np.append(start.slip, 0.0), start.tool.radius)
        return (
            before
            if start.in_contact
            else first_touch(before, tool, self.setup.geometry, self.is_clear)
        )

    def _solve_with_friction(
        self,
        model: BlockModel,
        positions: FloatArray,
        tools: tuple[ToolSphere, ToolSphere],
        past: FrictionState,
        tool: ToolSphere,
    ) -> Equilibrium:
        """Equilibrium with friction under the tool, whose `tools` before and now are in the frame
        of the slid block.
        """
        friction = self.setup.tool.friction_coefficient
        recall = None if self.material_history is None else self.material_history.apply_to
        solution, history = solve_with_friction(
            model, positions, tools, past, friction, self.tolerance, self._quick_solver, recall
        )
        return replace(self._equilibrium(solution, model.mesh, tool), friction_history=history)

    def _advance(self, tool: ToolSphere, start: Equilibrium) -> Equilibrium:
        """Equilibrium at `tool`; with friction by way of places so near that each point's way
        between two is known.
        """
        if not self.setup.tool.friction_coefficient:
            return self.solve_with_fixed_base(tool, start)
        slip = np.append(self.slip, 0.0)
        begin = (
            self.approach_start(start, ToolSphere(tool.centre - slip, tool.radius)).centre + slip
        )
        steps = max(1, int(np.ceil(float(np.linalg.norm(tool.centre - begin)) / self._drag_step)))
        path = [start]
        for share in np.arange(1, steps + 1) / steps:
            path.append(
                self.solve_with_fixed_base(
                    ToolSphere(begin + share * (tool.centre - begin), tool.radius), path[-1]
                )
            )
            if path[-1].outcome is not Outcome.CONVERGED:
                break
        return self._with_path(path[1:-1], path[-1])

    def _with_path(self, path: Sequence[Equilibrium], frame: Equilibrium) -> Equilibrium:
        """A frame with what was on the way to it."""
        found = replace(frame, path=tuple(path))
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
        if self.material_history is not None:
            self.material_history.begin(time)
        slip, frame = self.slip, self._solve_compliant(centre, start)
        if frame.outcome is not Outcome.CONVERGED and self.setup.tool.compliance_times_stiffness:
            # Of several solves some may have let the tool slip in between the points that feel it;
            # and where one grid gives way to another, which resists otherwise, a tool on a spring
            # may find its balance on neither.
            self.slip, self.dense = slip, True
            self._mesh = frame.mesh if frame.outcome is Outcome.TOOL_SWINGS else None
            frame = self._solve_compliant(centre, start)
            self._mesh = None
        if frame.outcome is not Outcome.CONVERGED:
            self.slip = slip
        if self.material_history is not None:
            self.material_history.end(frame)
        return frame

    def solve_from_any(
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

    def _solve_compliant(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the tool, or the other end of the spring on which it gives way, at
        `centre` (3,) [m].
        """
        if self.setup.tool.compliance_times_stiffness:
            return solve_compliant_tool(
                centre, start, self.setup, self.tolerance, self._solve_placed
            )
        return self._solve_placed(centre, start)

    def _solve_placed(self, centre: FloatArray, start: Equilibrium) -> Equilibrium:
        """Equilibrium with the tool's centre held here (3,) [m]; slides the base if it cannot
        hold."""
        tool = ToolSphere(centre, self.setup.tool.radius)
        frame, friction = self._advance(tool, start), self.setup.support.friction_coefficient
        return frame if friction is None else self._slide(tool, frame, friction)

    def _slide(self, tool: ToolSphere, frame: Equilibrium, friction: float) -> Equilibrium:
        """Move the base until friction holds: Coulomb, with the weight and the push as its load."""
        weight, path = weight_of(self.setup), [frame]
        for _ in range(_MOST_SLIDES):
            step = slip_step(path[-1], friction, weight)
            if step is None or path[-1].outcome is not Outcome.CONVERGED:
                break
            self.slip = self.slip + step
            path.append(self.solve_with_fixed_base(tool, path[-1]))
        else:
            path[-1] = replace(path[-1], outcome=Outcome.BASE_SLIDES)
        return self._with_path([*frame.path, replace(frame, path=()), *path[1:]][:-1], path[-1])


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
    since: ReplayState | None = None,
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
    if starts is not None and setup.has_history:
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
        frame = block.solve_from_any(centre, (start, previous), time)
        frames.append(frame)
        previous = (
            frame if frame.outcome is Outcome.CONVERGED else previous if setup.has_history else None
        )
    return frames
