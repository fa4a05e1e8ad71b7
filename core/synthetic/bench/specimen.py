"""The virtual block on the bench, from one place of the tool to the next: its base held, slipping
or on springs, its past in it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.bench.motion_plan import Probe
from palpate.synthetic.bench.solved_track import Moment, Passage
from palpate.synthetic.bench.true_body import creep_of, solid_of, true_offset, true_radius
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.coulomb_friction import Dragging, Rub
from palpate.synthetic.solver.inelastic_history import Past, Remembering
from palpate.synthetic.solver.shaft_compliance import give_way
from palpate.synthetic.solver.tet_block import Block
from palpate.synthetic.solver.tet_equilibrium import Equilibrium, GivesWay, State
from palpate.synthetic.solver.tool_clearance import Reach

__all__ = ["Specimen", "Standing"]

KEY_SPACING, SLIDING_SPACING, DRAGGED_SPACING = 1.0e-3, 1.3e-3, 0.8e-3
"""Way between two keys [m]: of a tool that presses, that slides along, and that drags the surface
along."""
GRAVITY = 9.81
_MOST_HALVED = 3
"""How often a step of a tool that drags the surface along is halved, where it is too long."""
_SET, _MOST_SETS = 2e-6, 12
"""Change of the displacement [m] at which an equilibrium and the set that it brings agree."""
_FIRST_WAIT, _LONGER = (0.1, 0.25), 1.6
"""First step of a rest: least [s], and share of the time constant; each further one is so much
longer."""


@dataclass(frozen=True, eq=False)
class Standing:
    """What a block is left with, from which it can go on."""

    slip: FloatArray
    last: State
    before: State
    past: Past | None


class Specimen:
    """One block with its solver, how far it has slipped, and what it remembers."""

    def __init__(
        self, scenario: Scenario, block: Block, slip: FloatArray, axis: FloatArray | None = None
    ) -> None:
        self.block = block
        self.solver = Equilibrium(block, solid_of(scenario, block, axis))
        self.offset = true_offset(scenario)
        self.radius = true_radius(scenario)
        hidden = scenario.hidden("base_slip")
        self.friction = hidden.value("friction_coefficient") if hidden else None
        self.weight = scenario.mass * GRAVITY
        giving = scenario.hidden("tool_compliance")
        self.softness = (
            giving.value("compliance_times_stiffness") / scenario.true_modulus if giving else 0.0
        )
        self.slip = slip
        self.creep = creep_of(scenario)
        lasting = scenario.remembers
        self.memory = Remembering(scenario, block) if lasting else None
        if self.memory is not None:
            self.memory.settle(self.solver.rest.displacement)
        rough = scenario.hidden("tool_friction")
        self.drag = (
            Dragging(block, rough.value("friction_coefficient"), self.radius, self.solver.hardest)
            if rough
            else None
        )
        self.settled = np.asarray(block.surface @ self.solver.rest.displacement)
        self._reach = Reach(
            block.surface_rest + self.settled,
            block.surface_normals,
            self.radius,
            self.solver.solid.shaft,
        )
        self._last = self._before = self.solver.rest
        self._mesh: Delaunay | None = None
        self._stated: FloatArray | None = None

    def close(self) -> None:
        self.solver.close()

    @property
    def standing(self) -> Standing:
        """As it is now."""
        return Standing(
            self.slip, self._last, self._before, None if self.memory is None else self.memory.past
        )

    def resume(self, standing: Standing) -> None:
        """Go on from there."""
        self.slip, self._last, self._before = standing.slip, standing.last, standing.before
        if self.memory is not None and standing.past is not None:
            self.memory.past = standing.past

    @property
    def surface(self) -> FloatArray:
        """Displacement (s, 3) of the drawn surface from the stated shape [m], slip included, as the
        last key left it.
        """
        return np.asarray(self.block.surface @ self._last.displacement) + self.slip

    @property
    def _ordered(self) -> bool:
        """Whether the way back is another than the way in."""
        return (
            self._goes_on
            or self.friction is not None
            or self.memory is not None
            or self.drag is not None
        )

    @property
    def _goes_on(self) -> bool:
        """Whether something happens while the tool stands still."""
        return bool(self.creep.any()) or (self.memory is not None and self.memory.delays)

    def passages(self, probe: Probe, until: float) -> tuple[Passage, ...]:
        """All passages of one probe in order of time, and the rest after it `until` the next [s],
        if anything goes on there.
        """
        passages: list[Passage] = []
        for number, (first, last) in enumerate(pairwise(probe.arcs)):
            if first == last:
                if self._goes_on:
                    passages.append(self._wait(probe, number, float(probe.times[number + 1])))
                continue
            low, high = float(min(first, last)), float(max(first, last))
            known = next(
                (
                    one
                    for one in passages
                    if not self._ordered and (one.arcs[0], one.arcs[-1]) == (low, high)
                ),
                None,
            )
            if known is None:
                arcs = self._keys(probe, low, high)
                ordered = arcs if first < last else arcs[::-1]
                times = probe.when(number, ordered)
                moments = [
                    self.moment(place + self.offset, float(time))
                    for place, time in zip(probe.place(ordered), times, strict=True)
                ]
                moments = moments if first < last else moments[::-1]
            else:
                arcs, moments = known.arcs, list(known.moments)
            passages.append(
                Passage(
                    float(probe.times[number]), float(probe.times[number + 1]), arcs, tuple(moments)
                )
            )
        if self._goes_on:
            passages.append(self._wait(probe, len(probe.times) - 1, until))
        return tuple(passages)

    def _wait(self, probe: Probe, number: int, until: float) -> Passage:
        """The tool stands where it was at a knot of the probe; keys lie the farther apart the
        longer it has stood.
        """
        centre, times = (
            probe.place(probe.arcs[number : number + 1])[0] + self.offset,
            [float(probe.times[number])],
        )
        step = (
            _FIRST_WAIT[1]
            if self.memory is None
            else max(_FIRST_WAIT[0], _FIRST_WAIT[1] * self.memory.time_constant)
        )
        while times[-1] + 1.3 * step < until:
            times.append(times[-1] + step)
            step *= _LONGER
        times.append(until)
        moments = tuple(self.moment(centre, time) for time in times)
        return Passage(times[0], until, np.array(times), moments, timed=True)

    def _keys(self, probe: Probe, low: float, high: float) -> FloatArray:
        """Where to solve: evenly while the tool presses, and once more just after contact
        begins."""
        fine = np.linspace(low, high, 2 + int((high - low) / 5e-5))
        touching = np.nonzero(self._reach.gap(probe.place(fine) + self.offset - self.slip) < 0)[0]
        if not len(touching):
            return np.linspace(low, high, 5) if self._goes_on else np.array([low, high])
        begin, end = fine[max(touching[0] - 1, 0)], fine[min(touching[-1] + 1, len(fine) - 1)]
        sliding = begin == low and end == high
        spacing = SLIDING_SPACING if sliding else KEY_SPACING
        spacing = DRAGGED_SPACING if self.drag is not None else spacing
        keys = [np.array([low, high]), np.linspace(begin, end, 2 + int((end - begin) / spacing))]
        keys += [begin + np.array([0.3e-3])] if begin > low else []
        keys += [end - np.array([0.3e-3])] if end < high else []
        keys += [np.linspace(low, begin, 4)] if self._goes_on else []
        return np.unique(np.clip(np.concatenate(keys), low, high))

    def moment(self, centre: FloatArray, time: float | None = None) -> Moment:
        """With the tool's stated centre here (3,) [m], at a time [s] for a block that remembers or
        creeps.
        """
        before = self._last
        if time is not None and self.creep.any():
            self.slip = self.creep * time
        state = self._lived(centre, time) if self.memory is not None else self._reached(centre)
        if self.drag is not None:
            self.drag.leave(state.displacement, state.centre)
        if self.memory is not None or self.drag is not None:
            # The next place is guessed from the last two that were found, not from two on the way
            # to one.
            self._before, self._last = before, state
        self._stated = centre
        surface = np.asarray(self.block.surface @ state.displacement) + self.slip
        return Moment(
            surface,
            self.slip[:2].copy(),
            state.push,
            state.penetration,
            state.centre + self.slip - centre,
        )

    def _lived(self, centre: FloatArray, time: float | None) -> State:
        """With what the material remembers, its own set included."""
        memory = self.memory
        assert memory is not None
        self.solver.metric = memory.metric(time)
        state = self._reached(centre)
        for _ in range(_MOST_SETS if memory.fraction else 0):
            self.solver.metric = memory.metric(time, memory.after(state.displacement, time).natural)
            before, state = state, self._found(centre)
            if np.abs(state.displacement - before.displacement).max() < _SET:
                break
        memory.past = memory.after(state.displacement, time)
        return state

    def _reached(self, centre: FloatArray, depth: int = 0) -> State:
        """By way of nearer places, where friction and pressure find no agreement in one step."""
        standing = self.standing
        try:
            return self._found(centre)
        except GivesWay:
            raise
        except SolveError as error:
            if self.drag is None or self._stated is None:
                raise
            if (
                depth >= _MOST_HALVED
            ):  # as deep as this tool can be led: the operator stops short of it
                raise GivesWay(str(error)) from error
        self.resume(standing)
        middle = 0.5 * (self._stated + centre)
        state = self._reached(middle, depth + 1)
        self.drag.leave(state.displacement, state.centre)
        self._stated = middle
        return self._reached(centre, depth + 1)

    def _found(self, centre: FloatArray) -> State:
        """With friction under the base holding."""
        state = self._balanced(centre - self.slip)
        return (
            self._slide(centre, state)
            if self.friction is not None and self._excess(state) > 0
            else state
        )

    def _excess(self, state: State) -> float:
        """Sideways push beyond what friction holds [N]."""
        assert self.friction is not None
        return float(np.linalg.norm(state.push[:2])) - self.friction * max(
            self.weight - float(state.push[2]), 0.0
        )

    def _slide(self, centre: FloatArray, state: State) -> State:
        """Move the base along the push until friction holds it: Newton on the length of the slide,
        within a bracket.
        """
        assert self.friction is not None
        direction = np.array([*state.push[:2], 0.0]) / np.linalg.norm(state.push[:2])
        start, length, short, long = self.slip, 0.0, 0.0, np.inf
        for _ in range(40):
            excess = self._excess(state)
            if abs(excess) < 1e-3 * self.friction * self.weight or (
                excess < 0 and long - short < 1e-6
            ):
                return state
            short, long = (max(short, length), long) if excess > 0 else (short, min(long, length))
            change = state.compliance @ direction
            rate = float(change @ direction) + self.friction * float(change[2])
            step = excess / max(rate, 1e-2 * self.solver.modulus * self.radius)
            length += float(np.clip(step, -0.7e-3, 0.7e-3))
            if not short < length < long:
                length = 0.5 * (short + long) if np.isfinite(long) else short + 0.3e-3
            self.slip = start + length * direction
            state = self._balanced(centre - self.slip)
        raise SolveError(
            f"the base of the virtual block finds no rest after sliding {length * 1e3:.2g} mm",
            residual=excess,
        )

    def _balanced(self, centre: FloatArray) -> State:
        """With the tool, or the end of the shaft on which it gives way, at `centre` (3,) [m] in the
        frame of the slid block.
        """
        if not self.softness:
            return self._elastic(centre)
        before = self._last
        state = give_way(centre, self.softness, centre - self.softness * before.push, self._elastic)
        # The next place is guessed from the last two that were balanced, not from two on the way to
        # one.
        self._before, self._last = before, state
        return state

    def _elastic(self, centre: FloatArray) -> State:
        if self._reach.gap(centre[None])[0] > 0.1e-3:
            state = self._alone(centre)
        elif self.drag is not None:
            state = self._dragged(self.drag, centre)
        else:
            state = self._from_last(centre)
        self._before, self._last = self._last, state
        return state

    def _alone(self, centre: FloatArray) -> State:
        """Without the tool: as it settled, or, with a memory, on its way there."""
        still = State(self.solver.rest.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
        if self.memory is None or self.memory.untouched:
            return still
        return self.solver.state(
            centre, State(self._last.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
        )

    def _dragged(self, drag: Dragging, centre: FloatArray) -> State:
        """With the tool dragging the surface along."""
        state: State | None = None

        def solve(rub: Rub | None) -> FloatArray:
            nonlocal state
            self.solver.rub = rub
            state = self._from_last(centre) if state is None else self.solver.state(centre, state)
            return state.displacement

        try:
            drag.found(centre, solve)
        finally:
            self.solver.rub = None
        assert state is not None
        return state

    def _from_last(self, centre: FloatArray) -> State:
        step, before = centre - self._last.centre, self._last.centre - self._before.centre
        if np.linalg.norm(step) > 2e-3:
            start = self.solver.rest if self.memory is None else self._last
            self._last = State(start.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
            return self.solver.state(centre, self._last)
        push = self._last.push
        if np.any(push) and abs(step @ push) < 0.3 * np.linalg.norm(step) * np.linalg.norm(push):
            return self.solver.state(centre, self._last, self._carried(step))
        ratio = float(step @ before) / max(float(before @ before), 1e-12)
        if not (0.2 < ratio < 2.5 and np.any(self._before.push)):
            return self.solver.state(centre, self._last)
        guess = self._last.displacement + ratio * (
            self._last.displacement - self._before.displacement
        )
        return self.solver.state(centre, self._last, guess)

    def _carried(self, step: FloatArray) -> FloatArray:
        """The last displacement, moved along with the tool: near the truth while the tool
        slides."""
        nodes = self.block.nodes
        if self._mesh is None:
            self._mesh = Delaunay(nodes)
        places = np.clip(nodes - step * 0.999, nodes.min(axis=0), nodes.max(axis=0))
        moved = LinearNDInterpolator(self._mesh, self._last.displacement)(places)
        return np.where(
            self.solver.solid.held[:, None] | np.isnan(moved), self._last.displacement, moved
        )
