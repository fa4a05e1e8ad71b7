"""The virtual block under a whole motion: solved at key places along the way, its base held, slipping or on springs."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay, cKDTree

from core.errors import SolveError
from core.frames import FloatArray
from core.synthetic.block import Block, Grading, IntArray, mesh_block
from core.synthetic.body import levels_of, solid_of, true_offset, true_radius
from core.synthetic.equilibrium import Equilibrium, GivesWay, State
from core.synthetic.motion import Motion, Probe
from core.synthetic.scenario import Scenario
from core.synthetic.track import Moment, Passage, Stretch, Track
from core.synthetic.yielding import give_way

__all__ = ["neutral_displacement", "perform", "rest_surface"]

KEY_SPACING = 1.0e-3
SLIDING_SPACING = 1.3e-3
GRAVITY = 9.81
SHORTER, MOST_SHORT = 1.0e-3, 4.5e-3


def perform(scenario: Scenario, motion: Motion, fine: float | None = None) -> Track:
    """Solve one motion of a scenario; every probe gets a grid that is fine where it touches.

    Pressed against a hard lump, the block gives way at some depth: it jumps aside, and the tool leads to no equilibrium any more.
    The operator stops such a push short of it; the track's motion is the one that was carried out.
    """
    slip, stretches = np.zeros(3), []
    for probe in motion.probes:
        stretch, slip = _as_deep_as_it_goes(scenario, probe, slip, fine or scenario.fine)
        stretches.append(stretch)
    return Track(replace(motion, probes=tuple(stretch.probe for stretch in stretches)), tuple(stretches))


def _as_deep_as_it_goes(scenario: Scenario, probe: Probe, slip: FloatArray, fine: float) -> tuple[Stretch, FloatArray]:
    """One probe from a base that has slipped by `slip` (3,) [m], and the slip after it."""
    for short in np.arange(0.0, MOST_SHORT, SHORTER):
        tried = probe.shallower(float(short))
        block = mesh_block(scenario.true_size, _grading(scenario, tried, fine))
        bench = _Bench(scenario, block, slip)
        try:
            return Stretch(tried, block.surface_rest, block.surface_faces, bench.settled + slip, bench.passages(tried)), bench.slip
        except GivesWay as error:
            failure = error
        finally:
            bench.close()
    raise failure


def neutral_displacement(scenario: Scenario, stretch: Stretch, centre: FloatArray) -> FloatArray:
    """Displacement (s, 3) [m] of the drawn surface of `stretch` with no hidden effect and the tool's stated centre (3,) [m].

    Where the block has another size than believed, it is from the true rest shape to where the believed block would have been.
    """
    believed = replace(scenario, effects=())
    low, high = _bounds(believed)
    grading = _grading(scenario if scenario.true_size == scenario.size else believed, stretch.probe, scenario.fine)
    bench = _Bench(believed, mesh_block(scenario.size, grading), np.zeros(3))
    try:
        outwards = centre - np.clip(centre, low, high)
        outwards = outwards / np.linalg.norm(outwards) if np.any(outwards) else stretch.probe.outwards
        surface = [bench.moment(centre + outwards * clear) for clear in np.arange(8e-3, -1e-9, -1.6e-3)][-1].surface
        if scenario.true_size == scenario.size:
            return surface
        places = stretch.rest * (np.array(scenario.size) / np.array(scenario.true_size))
        nearest = cKDTree(bench.block.surface_rest).query(places)[1]
        return np.asarray(places + surface[nearest] - stretch.rest)
    finally:
        bench.close()


def rest_surface(scenario: Scenario) -> tuple[FloatArray, FloatArray, IntArray]:
    """The untouched block: drawn surface of the true shape (s, 3), its displacement (s, 3) [m], and triangles (t, 3)."""
    grading = Grading(np.zeros((1, 3)), np.zeros(1), np.full(1, 8e-3), 8e-3, 0.5, levels_of(scenario))
    block = mesh_block(scenario.true_size, grading)
    bench = _Bench(scenario, block, np.zeros(3))
    bench.close()
    return block.surface_rest, bench.settled, block.surface_faces


def _bounds(scenario: Scenario) -> tuple[FloatArray, FloatArray]:
    x, y, z = scenario.true_size
    return np.array([-x / 2, -y / 2, 0.0]), np.array([x / 2, y / 2, z])


def _grading(scenario: Scenario, probe: Probe, fine: float) -> Grading:
    """Fine where the probe first touches, and along a drag; a lump gets elements smaller than its radius."""
    low, high = _bounds(scenario)
    radius = true_radius(scenario)
    way = probe.place(np.arange(0.0, probe.corners[-1] + 1e-3, 1.0e-3)) + true_offset(scenario)
    touching = way[np.linalg.norm(way - np.clip(way, low, high), axis=1) < radius]
    touching = touching if len(touching) else way[-1:]
    shallow = touching[:1] if len(probe.waypoints) == 2 else touching[touching[:, 2] < touching[:, 2].min() + 1e-4]
    points = _on_surface(shallow, low, high)
    reach = np.full(len(points), (0.8 if len(points) == 1 else 0.5) * radius)
    edges = np.full(len(points), fine if len(points) == 1 else 1.2 * fine)
    lump = scenario.hidden("stiff_inclusion")
    if lump is not None:
        points = np.concatenate([points, [[lump.value(axis) for axis in "xyz"]]])
        reach = np.append(reach, lump.value("radius"))
        edges = np.append(edges, max(fine, 0.7 * lump.value("radius")))
    return Grading(points, reach, edges, levels=levels_of(scenario))


def _on_surface(centres: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """The points (n, 3) of the block's faces next to tool centres (n, 3), inside or outside [m]."""
    points = np.clip(centres, low, high)
    inside = np.all((centres > low) & (centres < high), axis=1)
    points[inside, 2] = high[2]
    return points


class _Bench:
    """One block with its solver, and how far it has slipped."""

    def __init__(self, scenario: Scenario, block: Block, slip: FloatArray) -> None:
        self.block = block
        self.solver = Equilibrium(block, solid_of(scenario, block))
        self.offset = true_offset(scenario)
        self.radius = true_radius(scenario)
        hidden = scenario.hidden("base_slip")
        self.friction = hidden.value("friction_coefficient") if hidden else None
        self.weight = scenario.mass * GRAVITY
        giving = scenario.hidden("tool_compliance")
        self.softness = giving.value("compliance_times_stiffness") / scenario.true_modulus if giving else 0.0
        self.slip = slip
        self.settled = np.asarray(block.surface @ self.solver.rest.displacement)
        self._tree = cKDTree(block.surface_rest + self.settled)
        self._last = self._before = self.solver.rest
        self._mesh: Delaunay | None = None

    def close(self) -> None:
        self.solver.close()

    def passages(self, probe: Probe) -> tuple[Passage, ...]:
        """All passages of one probe in order of time; without slip the way back is the way in."""
        passages: list[Passage] = []
        for number, (first, last) in enumerate(pairwise(probe.arcs)):
            if first == last:
                continue
            low, high = float(min(first, last)), float(max(first, last))
            known = next((one for one in passages if self.friction is None and (one.arcs[0], one.arcs[-1]) == (low, high)), None)
            if known is None:
                arcs = self._keys(probe, low, high)
                ordered = arcs if first < last else arcs[::-1]
                moments = [self.moment(place + self.offset) for place in probe.place(ordered)]
                moments = moments if first < last else moments[::-1]
            else:
                arcs, moments = known.arcs, list(known.moments)
            passages.append(Passage(float(probe.times[number]), float(probe.times[number + 1]), arcs, tuple(moments)))
        return tuple(passages)

    def _keys(self, probe: Probe, low: float, high: float) -> FloatArray:
        """Where to solve: evenly while the tool presses, and once more just after contact begins."""
        fine = np.linspace(low, high, 2 + int((high - low) / 5e-5))
        touching = np.nonzero(self._gap(probe.place(fine) + self.offset) < 0)[0]
        if not len(touching):
            return np.array([low, high])
        begin, end = fine[max(touching[0] - 1, 0)], fine[min(touching[-1] + 1, len(fine) - 1)]
        sliding = begin == low and end == high
        spacing = SLIDING_SPACING if sliding else KEY_SPACING
        keys = [np.array([low, high]), np.linspace(begin, end, 2 + int((end - begin) / spacing))]
        keys += [begin + np.array([0.3e-3])] if begin > low else []
        keys += [end - np.array([0.3e-3])] if end < high else []
        return np.unique(np.clip(np.concatenate(keys), low, high))

    def _gap(self, centres: FloatArray) -> FloatArray:
        """From the sphere to the settled block (n,) [m], negative where it presses."""
        return np.asarray(self._tree.query(centres - self.slip)[0]) - self.radius

    def moment(self, centre: FloatArray) -> Moment:
        state = self._balanced(centre - self.slip)
        if self.friction is not None and self._excess(state) > 0:
            state = self._slide(centre, state)
        surface = np.asarray(self.block.surface @ state.displacement) + self.slip
        return Moment(surface, self.slip[:2].copy(), state.push, state.penetration, state.centre + self.slip - centre)

    def _excess(self, state: State) -> float:
        """Sideways push beyond what friction holds [N]."""
        assert self.friction is not None
        return float(np.linalg.norm(state.push[:2])) - self.friction * max(self.weight - float(state.push[2]), 0.0)

    def _slide(self, centre: FloatArray, state: State) -> State:
        """Move the base along the push until friction holds it: Newton on the length of the slide, within a bracket."""
        assert self.friction is not None
        direction = np.array([*state.push[:2], 0.0]) / np.linalg.norm(state.push[:2])
        start, length, short, long = self.slip, 0.0, 0.0, np.inf
        for _ in range(40):
            excess = self._excess(state)
            if abs(excess) < 1e-3 * self.friction * self.weight or (excess < 0 and long - short < 1e-6):
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
        raise SolveError(f"the base of the virtual block finds no rest after sliding {length * 1e3:.2g} mm", residual=excess)

    def _balanced(self, centre: FloatArray) -> State:
        """With the tool, or the end of the shaft on which it gives way, at `centre` (3,) [m] in the frame of the slid block."""
        if not self.softness:
            return self._elastic(centre)
        before = self._last
        state = give_way(centre, self.softness, centre - self.softness * before.push, self._elastic)
        # The next place is guessed from the last two that were balanced, not from two on the way to one.
        self._before, self._last = before, state
        return state

    def _elastic(self, centre: FloatArray) -> State:
        if self._tree.query(centre)[0] > self.radius + 0.1e-3:
            state = State(self.solver.rest.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
        else:
            state = self._from_last(centre)
        self._before, self._last = self._last, state
        return state

    def _from_last(self, centre: FloatArray) -> State:
        step, before = centre - self._last.centre, self._last.centre - self._before.centre
        if np.linalg.norm(step) > 2e-3:
            self._last = State(self.solver.rest.displacement, centre, np.zeros(3), np.zeros((3, 3)), 0.0)
            return self.solver.state(centre, self._last)
        push = self._last.push
        if np.any(push) and abs(step @ push) < 0.3 * np.linalg.norm(step) * np.linalg.norm(push):
            return self.solver.state(centre, self._last, self._carried(step))
        ratio = float(step @ before) / max(float(before @ before), 1e-12)
        if not (0.2 < ratio < 2.5 and np.any(self._before.push)):
            return self.solver.state(centre, self._last)
        guess = self._last.displacement + ratio * (self._last.displacement - self._before.displacement)
        return self.solver.state(centre, self._last, guess)

    def _carried(self, step: FloatArray) -> FloatArray:
        """The last displacement, moved along with the tool: near the truth while the tool slides."""
        nodes = self.block.nodes
        if self._mesh is None:
            self._mesh = Delaunay(nodes)
        places = np.clip(nodes - step * 0.999, nodes.min(axis=0), nodes.max(axis=0))
        moved = LinearNDInterpolator(self._mesh, self._last.displacement)(places)
        return np.where(self.solver.solid.held[:, None] | np.isnan(moved), self._last.displacement, moved)
