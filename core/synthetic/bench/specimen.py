"""The virtual block on the bench: its equilibrium from one tool position to the next.

The base is held, slips with friction or stands on springs; the material may have a history.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.bench.solved_track import KeyFrame
from palpate.synthetic.bench.true_body import creep_velocity, solid_model, true_offset, true_radius
from palpate.synthetic.laws.support_laws import slip_limit
from palpate.synthetic.laws.tool_laws import drag_limits, shaft_softness
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.coulomb_friction import CoulombFriction, FrictionContact
from palpate.synthetic.solver.inelastic_history import InelasticHistory, InelasticState
from palpate.synthetic.solver.shaft_compliance import solve_compliant_shaft, times
from palpate.synthetic.solver.tet_block import TetBlock
from palpate.synthetic.solver.tet_equilibrium import InstabilityError, TetSolver, TetState
from palpate.synthetic.solver.tool_clearance import ToolClearance

__all__ = ["Specimen", "SpecimenSnapshot"]

GRAVITY = 9.81
_MOST_HALVED = 3
"""Number of halvings of a step with tool friction before it counts as unstable."""
_SET, _MOST_SETS = 2e-6, 12
"""Change of the displacement [m] at which equilibrium and permanent set have converged, and the
largest number of iterations."""


@dataclass(frozen=True, eq=False)
class SpecimenSnapshot:
    """State of a specimen to which it can be restored.

    Attributes:
        slip: (3,) of the base [m].
        last: the last equilibrium.
        before: the one before it.
        inelastic_state: of the material; None without a history.
    """

    slip: FloatArray
    last: TetState
    before: TetState
    inelastic_state: InelasticState | None


class Specimen:
    """One block with its solver, the slip of its base and the history of its material."""

    def __init__(
        self, scenario: Scenario, block: TetBlock, slip: FloatArray, axis: FloatArray | None = None
    ) -> None:
        self.block = block
        self.solver = TetSolver(block, solid_model(scenario, block, axis))
        self._scenario = scenario
        self.radius = true_radius(scenario)
        hidden = scenario.hidden("base_slip")
        self.sliding = hidden
        self.weight = scenario.mass * GRAVITY
        self.softness = shaft_softness(
            scenario.hidden("tool_compliance"), scenario.true_modulus, axis
        )
        self.slip = slip
        self.creep = creep_velocity(scenario)
        self.memory = InelasticHistory(scenario, block) if scenario.has_history else None
        if self.memory is not None:
            self.memory.settle(self.solver.rest.displacement)
        rough = scenario.hidden("tool_friction")
        self.drag = (
            CoulombFriction(
                block,
                partial(drag_limits, rough, modulus=scenario.true_modulus),
                self.radius,
                self.solver.hardest,
            )
            if rough
            else None
        )
        self.settled = np.asarray(block.surface @ self.solver.rest.displacement)
        self.clearance = ToolClearance(
            block.surface_rest + self.settled,
            block.surface_normals,
            self.radius,
            self.solver.solid.shaft,
        )
        self._last = self._before = self.solver.rest
        self._mesh: Delaunay | None = None
        self._stated: FloatArray | None = None

    def offset(self, centre: FloatArray) -> FloatArray:
        """Return true minus stated centre (..., 3) of the tool [m]."""
        return true_offset(self._scenario, centre)

    def close(self) -> None:
        """Free the solver's memory."""
        self.solver.close()

    @property
    def snapshot(self) -> SpecimenSnapshot:
        """The present state."""
        return SpecimenSnapshot(
            self.slip,
            self._last,
            self._before,
            None if self.memory is None else self.memory.inelastic_state,
        )

    def restore(self, snapshot: SpecimenSnapshot) -> None:
        """Continue from an earlier state."""
        self.slip, self._last, self._before = snapshot.slip, snapshot.last, snapshot.before
        if self.memory is not None and snapshot.inelastic_state is not None:
            self.memory.inelastic_state = snapshot.inelastic_state

    @property
    def surface(self) -> FloatArray:
        """Displacement (s, 3) of the drawn surface from the stated shape [m], slip included, after
        the last key frame.
        """
        return np.asarray(self.block.surface @ self._last.displacement) + self.slip

    @property
    def path_dependent(self) -> bool:
        """Whether unloading differs from loading."""
        return (
            self.changes_at_rest
            or self.sliding is not None
            or self.memory is not None
            or self.drag is not None
        )

    @property
    def changes_at_rest(self) -> bool:
        """Whether the block changes while the tool stands still."""
        return bool(self.creep.any()) or (self.memory is not None and self.memory.relaxes)

    def solve_key_frame(self, centre: FloatArray, time: float | None = None) -> KeyFrame:
        """Solve one key frame.

        Args:
            centre: (3,) stated centre of the tool [m].
            time: [s], for a block with a history or one that creeps.
        """
        before = self._last
        if time is not None and self.creep.any():
            self.slip = self.creep * time
        state = (
            self._solve_with_history(centre, time)
            if self.memory is not None
            else self._solve_in_substeps(centre)
        )
        if self.drag is not None:
            self.drag.finish_step(state.displacement, state.centre)
        if self.memory is not None or self.drag is not None:
            # The next guess uses the last two converged key frames, not substeps between them.
            self._before, self._last = before, state
        self._stated = centre
        surface = np.asarray(self.block.surface @ state.displacement) + self.slip
        return KeyFrame(
            surface,
            self.slip[:2].copy(),
            state.tool_force,
            state.penetration,
            state.centre + self.slip - centre,
        )

    def _solve_with_history(self, centre: FloatArray, time: float | None) -> TetState:
        """Solve with a material that has a history; iterate on the permanent set of this step."""
        memory = self.memory
        assert memory is not None
        self.solver.metric = memory.metric(time)
        state = self._solve_in_substeps(centre)
        for _ in range(_MOST_SETS if memory.fraction else 0):
            self.solver.metric = memory.metric(time, memory.after(state.displacement, time).natural)
            before, state = state, self._solve_with_base_friction(centre)
            if np.abs(state.displacement - before.displacement).max() < _SET:
                break
        memory.inelastic_state = memory.after(state.displacement, time)
        return state

    def _solve_in_substeps(self, centre: FloatArray, depth: int = 0) -> TetState:
        """Solve; halve the step where friction and pressure do not converge in one."""
        snapshot = self.snapshot
        try:
            return self._solve_with_base_friction(centre)
        except InstabilityError:
            raise
        except SolveError as error:
            if self.drag is None or self._stated is None:
                raise
            if depth >= _MOST_HALVED:  # the operator stops the push before this depth
                raise InstabilityError(str(error)) from error
        self.restore(snapshot)
        middle = 0.5 * (self._stated + centre)
        state = self._solve_in_substeps(middle, depth + 1)
        self.drag.finish_step(state.displacement, state.centre)
        self._stated = middle
        return self._solve_in_substeps(centre, depth + 1)

    def _solve_with_base_friction(self, centre: FloatArray) -> TetState:
        """Solve, and let the base slip where friction does not hold it."""
        state = self._solve_with_compliant_shaft(centre - self.slip)
        return (
            self._slide(centre, state)
            if self.sliding is not None and self._excess_force(state) > 0
            else state
        )

    def _excess_force(self, state: TetState) -> float:
        """Tangential force on the base beyond the Coulomb limit [N]; negative where it sticks."""
        assert self.sliding is not None
        held = slip_limit(self.sliding, self.weight - float(state.tool_force[2]), self.weight)
        return float(np.linalg.norm(state.tool_force[:2])) - held

    def _slide(self, centre: FloatArray, state: TetState) -> TetState:
        """Move the base along the force until friction holds it.

        Newton's method on the length of the slide, within a bracket; SolveError after 40 steps.
        """
        assert self.sliding is not None
        friction = self.sliding.value("friction_coefficient")
        direction = np.array([*state.tool_force[:2], 0.0]) / np.linalg.norm(state.tool_force[:2])
        start, length, short, long = self.slip, 0.0, 0.0, np.inf
        for _ in range(40):
            excess = self._excess_force(state)
            if abs(excess) < 1e-3 * friction * self.weight or (excess < 0 and long - short < 1e-6):
                return state
            short, long = (max(short, length), long) if excess > 0 else (short, min(long, length))
            change = state.contact_stiffness @ direction
            rate = float(change @ direction) + friction * float(change[2])
            step = excess / max(rate, 1e-2 * self.solver.modulus * self.radius)
            length += float(np.clip(step, -0.7e-3, 0.7e-3))
            if not short < length < long:
                length = 0.5 * (short + long) if np.isfinite(long) else short + 0.3e-3
            self.slip = start + length * direction
            state = self._solve_with_compliant_shaft(centre - self.slip)
        raise SolveError(
            f"the base of the virtual block finds no rest after sliding {length * 1e3:.2g} mm",
            residual=excess,
        )

    def _solve_with_compliant_shaft(self, centre: FloatArray) -> TetState:
        """Solve with the tool, or the far end of its compliant shaft, at `centre` (3,) [m] in the
        frame of the slid block.
        """
        if not np.any(self.softness):
            return self._elastic(centre)
        before = self._last
        state = solve_compliant_shaft(
            centre, self.softness, centre - times(self.softness, before.tool_force), self._elastic
        )
        # The next guess uses the last two converged states, not iterates between them.
        self._before, self._last = before, state
        return state

    def _elastic(self, centre: FloatArray) -> TetState:
        if self.clearance.gap(centre[None])[0] > 0.1e-3:
            state = self._solve_without_tool(centre)
        elif self.drag is not None:
            state = self._solve_with_tool_friction(self.drag, centre)
        else:
            state = self._solve_from_last(centre)
        self._before, self._last = self._last, state
        return state

    def _solve_without_tool(self, centre: FloatArray) -> TetState:
        """The state without contact: at rest, or, with a history, on the way there."""
        still = TetState(self.solver.rest.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
        if self.memory is None or self.memory.is_initial:
            return still
        return self.solver.state(
            centre, TetState(self._last.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
        )

    def _solve_with_tool_friction(self, drag: CoulombFriction, centre: FloatArray) -> TetState:
        """Solve with Coulomb friction between tool and surface."""
        state: TetState | None = None

        def solve(friction_contact: FrictionContact | None) -> FloatArray:
            nonlocal state
            self.solver.friction_contact = friction_contact
            state = (
                self._solve_from_last(centre) if state is None else self.solver.state(centre, state)
            )
            return state.displacement

        try:
            drag.solve(centre, solve)
        finally:
            self.solver.friction_contact = None
        assert state is not None
        return state

    def _solve_from_last(self, centre: FloatArray) -> TetState:
        step, before = centre - self._last.centre, self._last.centre - self._before.centre
        if np.linalg.norm(step) > 2e-3:
            start = self.solver.rest if self.memory is None else self._last
            self._last = TetState(start.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
            return self.solver.state(centre, self._last)
        tool_force = self._last.tool_force
        if np.any(tool_force) and abs(step @ tool_force) < 0.3 * np.linalg.norm(
            step
        ) * np.linalg.norm(tool_force):
            return self.solver.state(centre, self._last, self._advected_guess(step))
        ratio = float(step @ before) / max(float(before @ before), 1e-12)
        if not (0.2 < ratio < 2.5 and np.any(self._before.tool_force)):
            return self.solver.state(centre, self._last)
        guess = self._last.displacement + ratio * (
            self._last.displacement - self._before.displacement
        )
        return self.solver.state(centre, self._last, guess)

    def _advected_guess(self, step: FloatArray) -> FloatArray:
        """The last displacement, translated with the tool: a good guess while the tool slides."""
        nodes = self.block.nodes
        if self._mesh is None:
            self._mesh = Delaunay(nodes)
        places = np.clip(nodes - step * 0.999, nodes.min(axis=0), nodes.max(axis=0))
        moved = LinearNDInterpolator(self._mesh, self._last.displacement)(places)
        return np.where(
            self.solver.solid.held[:, None] | np.isnan(moved), self._last.displacement, moved
        )
