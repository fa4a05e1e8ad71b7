"""Equilibria of a block whose base stays where it is, frame after frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from palpate.fem.continuation import first_touch, move_tool
from palpate.fem.model import BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import RELATIVE_TOLERANCE, Outcome, Solution, blocked_by_base, solve
from palpate.foundation.arrays import FloatArray
from palpate.mesh.default_meshes import meshing_for
from palpate.mesh.protocol import Mesh, Meshing
from palpate.replay.equilibrium import Equilibrium, extrapolated, predict_from_similar
from palpate.replay.friction_step import FrictionState, solve_with_friction
from palpate.replay.jump_check import agree, is_doubtful, parts_between, pulls
from palpate.replay.material_history import MaterialHistory, ReplayState
from palpate.replay.work_budget import WorkBudget
from palpate.setup.setup import Setup

__all__ = ["FixedBaseReplay"]


class FixedBaseReplay:
    """A block under a tool at given positions, with a base that stays where it is.

    Args:
        setup: the experiment as assumed.
        grid: the mesh, unless the setup has one.
        tolerance: relative residual of a converged frame.

    Attributes:
        slip: (2,) accumulated slip of the base along x and y [m].
        dense: whether contact is evaluated at many points (`palpate.fem.model.BlockModel`).
        budget: of the work of each push.
        factorised: the frame whose tangent is factorised, its model and the factor's number
            (`palpate.gradients.frame_tangent.factorise_at`).
    """

    def __init__(self, setup: Setup, grid: Meshing, tolerance: float = RELATIVE_TOLERANCE) -> None:
        self.setup, self.grid, self.tolerance = setup, meshing_for(setup, grid), tolerance
        self._quick_solver, self.budget = ModifiedNewton(), WorkBudget()
        self._model: BlockModel | None = None
        self._mesh: Mesh | None = None
        self._before: tuple[Equilibrium, Equilibrium] | None = None
        # Becomes True once the quick solver failed on a frame: from then on each frame predicts the
        # next (`predict_from_similar`).
        self._use_similar = False
        self.factorised: tuple[Equilibrium, BlockModel, int] | None = None
        self.slip, self.dense = np.zeros(2), False
        self._rest_mesh = self.grid.mesh(setup, np.array([0.0, 0.0, setup.geometry.height]))
        self.material_history = MaterialHistory.of(setup, self.grid, self._rest_mesh)
        if self.material_history is not None:
            self.material_history.start(self.free)

    def state(self, frame: Equilibrium) -> ReplayState:
        """The state from which another replay of the same setup and grid can continue.

        `frame` is the last frame.
        """
        return ReplayState(
            frame, None if self.material_history is None else self.material_history.history
        )

    def resume(self, state: ReplayState) -> None:
        """Continue from a state; the next `step` starts from the state's frame."""
        self.slip = state.frame.slip.copy()
        if self.material_history is not None and state.history is not None:
            self.material_history.history = state.history

    def model(self, mesh: Mesh) -> BlockModel:
        """The block's potential on this mesh in the current time step; the last one is cached."""
        if self._model is None or self._model.mesh is not mesh or self._model.dense != self.dense:
            self._model = BlockModel(self.setup, mesh, dense=self.dense)
            self._model.spend = self.budget.spend
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
        """Solve for the equilibrium without the tool, from positions (n, 3) [m]."""
        return self._with_permanent_set(
            model, None, solve(model, None, positions, None, self.tolerance)
        )

    def _with_permanent_set(
        self, model: BlockModel, tool: ToolSphere | None, solution: Solution
    ) -> Solution:
        """Correct a solution for the permanent set that it causes."""
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
            hardness=1.0 if self._model is None else self._model.hardness,
            dense=self.dense,
        )

    def is_clear(self, tool: ToolSphere) -> bool:
        """Whether the tool cannot touch the block, with a margin for sagging and bulging."""
        slack = (
            5e-4
            if self.setup.load.specific_weight_over_stiffness or self.setup.material.has_history
            else 0.0
        ) + self.setup.largest_offset
        nearest = self.setup.geometry.nearest(tool.centre[None])[0]
        return bool(np.linalg.norm(tool.centre - nearest) > tool.radius + slack)

    def solve_with_fixed_base(self, tool: ToolSphere, start: Equilibrium) -> Equilibrium:
        """Solve for the equilibrium with the base where it is.

        Args:
            tool: phantom frame.
            start: frame to begin from.
        """
        local = ToolSphere(tool.centre - np.append(self.slip, 0.0), tool.radius)
        if self.is_clear(local):
            if self.material_history is None or self.material_history.fresh:
                return replace(self.free, slip=self.slip.copy(), tool=tool)
            # The grid stays at the dent.
            solution = self._solve_without_tool(
                self.model(start.mesh), start.mesh.nodes + start.displacement
            )
            return self._equilibrium(solution, start.mesh, tool)
        frame = self._solve_or_densify(tool, local, start)
        if is_doubtful(start, frame):
            frame = self._checked(self.approach_start(start, local), local, start, frame)
        self._before = (start, frame)
        return frame

    def _solve_or_densify(
        self, tool: ToolSphere, local: ToolSphere, start: Equilibrium
    ) -> Equilibrium:
        """Solve for the equilibrium under the tool, at more contact points if there is none.

        Args as in `_solve_contact`.
        """
        frame = self._solve_contact(tool, local, start)
        if frame.outcome not in (Outcome.CONVERGED, Outcome.BASE_IN_TOOL) and not self.dense:
            # Most likely the tool slipped in between the contact points, which smaller steps would
            # not prevent.
            self.dense = True
            frame = self._solve_contact(tool, local, start)
        return frame

    def _checked(
        self, before: ToolSphere, local: ToolSphere, start: Equilibrium, found: Equilibrium
    ) -> Equilibrium:
        """Check an equilibrium that was found in a jump by small steps.

        Args:
            before: tool at the start of the jump, in the frame of the block.
            local: tool at its end, in the frame of the block.
            start: frame to begin from.
            found: the frame at the end of the jump.

        Returns:
            `found` if steps lead to the same equilibrium; theirs if steps of half the length do;
                else the frame without equilibrium.
        """
        known = [found]
        for finer in (1, 2):
            parts = parts_between(before, local, finer)
            if not parts:
                return found
            frame = self._in_steps(parts, start)
            if frame.outcome is not Outcome.CONVERGED:
                break
            if (same := next((one for one in known if agree(one, frame)), None)) is not None:
                self.dense = same.dense
                return same
            known.append(frame)
        self.dense = found.dense
        return replace(found, outcome=Outcome.STEPS_DIFFER)

    def _in_steps(self, parts: Sequence[ToolSphere], start: Equilibrium) -> Equilibrium:
        """Solve at places of the tool in the frame of the block, one after another.

        Returns:
            the last frame, or the first one without equilibrium.
        """
        self._before, frame, slip = None, start, np.append(self.slip, 0.0)
        for place in parts:
            self.dense = frame.dense and frame.in_contact
            last, tool = frame, ToolSphere(place.centre + slip, place.radius)
            frame = self._solve_or_densify(tool, place, last)
            self._before = (last, frame)
            if frame.outcome is not Outcome.CONVERGED:
                break
        return frame

    def _solve_contact(
        self, tool: ToolSphere, local: ToolSphere, start: Equilibrium
    ) -> Equilibrium:
        """Solve for the equilibrium under the tool.

        Args:
            tool: phantom frame.
            local: the same tool in the frame of the block, which may have slipped.
            start: frame to begin from.
        """
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
        solution = self._with_permanent_set(model, local, solution)
        frame = self._equilibrium(solution, model.mesh, tool)
        if solution.converged and pulls(frame):
            return replace(frame, outcome=Outcome.PULLED)
        return frame

    def initial_state(
        self, tool: ToolSphere, start: Equilibrium
    ) -> tuple[BlockModel, FloatArray, ToolSphere, FloatArray]:
        """Set up a solve, in the frame of the block, which may have slipped.

        Returns:
            the model, initial positions (n, 3) [m], the tool before `tool`, and the motion of the
                grid's focus since `start` (3,) [m], by which the dent is carried along with the
                tool.
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
        """The tool at the start of the path from a frame to `tool`, in the frame of the block.

        Without contact in that frame, it is just before first contact.
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
        """Solve with friction under the tool.

        Args:
            model: of the block.
            positions: (n, 3) to begin from [m].
            tools: before and now, in the frame of the block.
            past: state of friction before the step.
            tool: now, phantom frame.
        """
        friction = self.setup.tool.friction_coefficient
        recall = None if self.material_history is None else self.material_history.apply_to
        solution, history = solve_with_friction(
            model, positions, tools, past, friction, self.tolerance, self._quick_solver, recall
        )
        return replace(self._equilibrium(solution, model.mesh, tool), friction_history=history)
