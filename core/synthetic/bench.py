"""The virtual block under a whole motion: its true surface and slip at any time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator, PchipInterpolator
from scipy.spatial import Delaunay, cKDTree

from core.errors import SolveError
from core.frames import FloatArray
from core.synthetic.block import Block, Grading, IntArray, mesh_block
from core.synthetic.equilibrium import Equilibrium, Solid, State
from core.synthetic.motion import Motion, Probe
from core.synthetic.scenario import Scenario

__all__ = ["Moment", "Track", "neutral_displacement", "perform", "rest_surface", "true_offset", "true_radius"]

KEY_SPACING = 1.0e-3
GRAVITY = 9.81


@dataclass(frozen=True)
class Moment:
    """A key of the motion that was solved.

    Attributes:
        surface: (s, 3) displacement of the drawn surface from the stated shape, slip included [m].
        slip: (2,) of the base in the plane [m].
        push: (3,) force of the tool on the block [N].
        penetration: the deepest surface point inside the tool [m].
    """

    surface: FloatArray
    slip: FloatArray
    push: FloatArray
    penetration: float


@dataclass(frozen=True)
class Passage:
    """One straight run along a probe: `moments` at growing arc lengths `arcs` [m], from `begin` to `end` [s]."""

    begin: float
    end: float
    arcs: FloatArray
    moments: tuple[Moment, ...]

    @cached_property
    def _between(self) -> Any:
        return PchipInterpolator(self.arcs, np.stack([moment.surface for moment in self.moments]))

    def surface(self, arc: float) -> FloatArray:
        """Displacement (s, 3) [m] at an arc length [m], by monotone cubics between the keys."""
        return np.asarray(self._between(np.clip(arc, self.arcs[0], self.arcs[-1])))


@dataclass(frozen=True)
class Track:
    """What the block does during one motion.

    Attributes:
        rest: (s, 3) drawn surface of the stated shape [m].
        faces: (t, 3).
        settled: (s, 3) displacement before any touch [m].
    """

    motion: Motion
    rest: FloatArray
    faces: IntArray
    settled: FloatArray
    passages: tuple[tuple[Passage, ...], ...]

    def surface(self, time: float) -> FloatArray:
        """The drawn surface (s, 3) [m] at a time [s]."""
        return self.rest + self.displacement(time)

    def displacement(self, time: float) -> FloatArray:
        """Displacement of the drawn surface (s, 3) from the stated shape [m] at a time [s]."""
        last = self.settled
        for probe, passages in zip(self.motion.probes, self.passages, strict=True):
            for passage in passages:
                if time < passage.begin:
                    return last
                if time < passage.end:
                    return passage.surface(float(probe.arc(np.array([time]))[0]))
                last = passage.surface(float(probe.arc(np.array([passage.end]))[0]))
        return last

    @property
    def moments(self) -> list[Moment]:
        """All solved keys."""
        return [moment for passages in self.passages for passage in passages for moment in passage.moments]

    @property
    def touched(self) -> list[float]:
        """Two instants [s] of the probe that presses hardest: on the way in, and at its end."""
        hardest = max(range(len(self.passages)), key=lambda number: np.linalg.norm(self.passages[number][0].moments[-1].push))
        probe, first = self.motion.probes[hardest], self.passages[hardest][0]
        way = np.linspace(first.begin, first.end, 200)
        return [float(way[np.argmax(probe.arc(way) > 0.8 * probe.arcs.max())]), float(probe.times[-1] + probe.times[0]) / 2]


def true_radius(scenario: Scenario) -> float:
    """Of the tool [m]."""
    hidden = scenario.hidden("tool_radius")
    return hidden.value("radius") if hidden else scenario.tool_radius


def true_offset(scenario: Scenario) -> FloatArray:
    """True minus stated centre of the tool (3,), phantom frame [m]."""
    hidden = scenario.hidden("tool_offset")
    return np.array([hidden.value(name) for name in ("dx", "dy", "dz")]) if hidden else np.zeros(3)


def perform(scenario: Scenario, motion: Motion, fine: float | None = None) -> Track:
    """Solve one motion of a scenario; the grid is fine wherever its probes touch."""
    block = mesh_block(scenario.size, _grading(scenario, motion, fine or scenario.fine))
    bench = _Bench(scenario, block)
    try:
        passages = tuple(bench.probe(probe) for probe in motion.probes)
        return Track(motion, block.surface_rest, block.surface_faces, bench.settled, passages)
    finally:
        bench.close()


def neutral_displacement(scenario: Scenario, motion: Motion, track: Track, time: float) -> FloatArray:
    """Where the drawn surface (s, 3) [m] of `track` would be if nothing but the sensors had hidden effects."""
    mechanical = [hidden for hidden in scenario.effects if hidden.effect not in ("time_offset", "camera_registration")]
    if not mechanical:
        return track.displacement(time)
    centre = motion.centre(np.array([time]))[0]
    bench = _Bench(replace(scenario, effects=()), mesh_block(scenario.size, _grading(scenario, motion, scenario.fine)))
    try:
        outwards = centre - np.clip(
            centre, [-0.5 * scenario.size[0], -0.5 * scenario.size[1], 0], np.array(scenario.size) * (0.5, 0.5, 1.0)
        )
        outwards = -motion.axis if not np.any(outwards) else outwards / np.linalg.norm(outwards)
        moments = [bench.moment(centre + outwards * clear) for clear in np.arange(8e-3, -1e-9, -1.6e-3)]
        return moments[-1].surface
    finally:
        bench.close()


def rest_surface(scenario: Scenario) -> tuple[FloatArray, FloatArray, IntArray]:
    """The untouched block: drawn surface of the stated shape (s, 3), its displacement (s, 3) [m], and triangles (t, 3)."""
    block = mesh_block(scenario.size, Grading(np.zeros((1, 3)), np.zeros(1), 8e-3, 8e-3, 0.5))
    bench = _Bench(scenario, block)
    bench.close()
    return block.surface_rest, bench.settled, block.surface_faces


def _grading(scenario: Scenario, motion: Motion, fine: float) -> Grading:
    offset, radius = true_offset(scenario), true_radius(scenario)
    places, reach = [], []
    for probe in motion.probes:
        way = probe.place(np.arange(0.0, probe.corners[-1] + 1e-3, 1.5e-3)) + offset
        low, high = np.array([-scenario.size[0] / 2, -scenario.size[1] / 2, 0.0]), np.array(scenario.size) * (0.5, 0.5, 1.0)
        nearest = np.clip(way, low, high)
        touching = np.linalg.norm(way - nearest, axis=1) < radius
        centres = nearest[touching]
        surface = np.where((way[touching] > low) & (way[touching] < high), way[touching], centres)
        places.append(surface if len(probe.waypoints) > 2 else centres[:1])
        reach.append(np.full(len(places[-1]), 0.6 * radius if len(probe.waypoints) > 2 else 0.8 * radius))
    lump = scenario.hidden("stiff_inclusion")
    grading = Grading(np.concatenate(places), np.concatenate(reach), fine)
    if lump is None:
        return grading
    ball = np.array([[lump.value(axis) for axis in "xyz"]])
    shell = max(0.0, lump.value("radius") - fine)
    return Grading(
        np.concatenate([grading.points, ball]), np.concatenate([grading.reach, [shell]]), fine, grading.coarse, grading.growth
    )


class _Bench:
    """One block with its solver, and how far it has slipped."""

    def __init__(self, scenario: Scenario, block: Block) -> None:
        self.block = block
        self.solver = Equilibrium(block, _solid(scenario, block))
        self.offset = true_offset(scenario)
        self.radius = true_radius(scenario)
        hidden = scenario.hidden("base_slip")
        self.friction = hidden.value("friction_coefficient") if hidden else None
        self.weight = scenario.mass * GRAVITY
        self.slip = np.zeros(3)
        self.settled = np.asarray(block.surface @ self.solver.rest.displacement)
        self._tree = cKDTree(block.surface_rest + self.settled)
        self._last = self._before = self.solver.rest
        self._mesh: Delaunay | None = None

    def close(self) -> None:
        self.solver.close()

    def probe(self, probe: Probe) -> tuple[Passage, ...]:
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
        """Where to solve: denser where contact begins, since the surface starts to move there with a vertical tangent of its own."""
        fine = np.linspace(low, high, 2 + int((high - low) / 5e-5))
        touching = np.nonzero(self._gap(probe.place(fine) + self.offset) < 0)[0]
        if not len(touching):
            return np.array([low, high])
        begin, end = fine[max(touching[0] - 1, 0)], fine[min(touching[-1] + 1, len(fine) - 1)]
        keys = [np.array([low, high]), np.linspace(begin, end, 2 + int((end - begin) / KEY_SPACING))]
        keys += [begin + np.array([0.3e-3])] if begin > low else []
        keys += [end - np.array([0.3e-3])] if end < high else []
        return np.unique(np.clip(np.concatenate(keys), low, high))

    def _gap(self, centres: FloatArray) -> FloatArray:
        """From the sphere to the settled block (n,) [m], negative where it presses."""
        return np.asarray(self._tree.query(centres - self.slip)[0]) - self.radius

    def moment(self, centre: FloatArray) -> Moment:
        state = self._elastic(centre - self.slip)
        if self.friction is not None and self._excess(state) > 0:
            state = self._slide(centre, state)
        surface = np.asarray(self.block.surface @ state.displacement) + self.slip
        return Moment(surface, self.slip[:2].copy(), state.push, state.penetration)

    def _excess(self, state: State) -> float:
        """Sideways push beyond what friction holds [N]."""
        assert self.friction is not None
        return float(np.linalg.norm(state.push[:2])) - self.friction * max(self.weight - float(state.push[2]), 0.0)

    def _slide(self, centre: FloatArray, state: State) -> State:
        """Move the base along the push until friction holds it: Newton on the length of the slide."""
        assert self.friction is not None
        direction = np.array([*state.push[:2], 0.0]) / np.linalg.norm(state.push[:2])
        start, length = self.slip, 0.0
        for _ in range(25):
            excess = self._excess(state)
            if abs(excess) < 5e-4 * self.friction * self.weight:
                return state
            change = state.compliance @ direction
            rate = float(change @ direction) + self.friction * float(change[2])
            length = max(length + np.clip(excess / max(rate, 1e-3 * self.solver.modulus * self.radius), -1e-3, 1e-3), 0.0)
            self.slip = start + length * direction
            state = self._elastic(centre - self.slip)
        raise SolveError(f"the base of the virtual block finds no rest after sliding {length * 1e3:.2g} mm", residual=excess)

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
            self._last = State(self.solver.rest.displacement, centre + (0, 0, 1e-3), np.zeros(3), np.zeros((3, 3)), 0.0)
            return self.solver.state(centre, self._last)
        if abs(step[2]) < 0.3 * np.linalg.norm(step) and np.any(self._last.push):
            return self.solver.guess(self._carried(step), centre, self._last)
        ratio = float(step @ before) / max(float(before @ before), 1e-12)
        if not (0.2 < ratio < 2.5 and np.any(self._before.push)):
            return self.solver.state(centre, self._last)
        guess = self._last.displacement + ratio * (self._last.displacement - self._before.displacement)
        return self.solver.guess(guess, centre, self._last)

    def _carried(self, step: FloatArray) -> FloatArray:
        """The last displacement, moved along with the tool: near the truth while the tool slides."""
        nodes = self.block.nodes
        if self._mesh is None:
            self._mesh = Delaunay(nodes)
        places = np.clip(nodes - step * 0.999, nodes.min(axis=0), nodes.max(axis=0))
        moved = LinearNDInterpolator(self._mesh, self._last.displacement)(places)
        return np.where(self.solver.solid.held[:, None] | np.isnan(moved), self._last.displacement, moved)


def _solid(scenario: Scenario, block: Block) -> Solid:
    modulus = np.full(block.weights.shape, scenario.young_modulus)
    lump = scenario.hidden("stiff_inclusion")
    if lump is not None:
        inside = np.linalg.norm(block.places - [lump.value(axis) for axis in "xyz"], axis=2) < lump.value("radius")
        modulus[inside] *= lump.value("stiffness_ratio")
    nu, weight = scenario.hidden("poisson_ratio"), scenario.hidden("gravity")
    held = block.nodes[:, 2] < 1e-9
    strip = scenario.hidden("base_detachment")
    if strip is not None:
        axis, sign = "xy".index(str(strip.parameters["edge"])[1]), -1.0 if str(strip.parameters["edge"])[0] == "-" else 1.0
        held &= scenario.size[axis] / 2 - sign * block.nodes[:, axis] >= strip.value("extent")
    return Solid(
        young_modulus=modulus,
        poisson_ratio=nu.value("nu") if nu else scenario.poisson_ratio,
        weight=weight.value("specific_weight_over_stiffness") * scenario.young_modulus if weight else 0.0,
        held=held,
        tool_radius=true_radius(scenario),
        lifts=strip is not None,
    )
