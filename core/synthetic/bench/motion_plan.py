"""Planned tool motions: pokes from above and from the side, and drags, with rests in between."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError

__all__ = ["MotionPlan", "PlannedPush", "draw_motion"]

HOVER = 6.5e-3
"""Distance between tool and block before a push [m]."""


@dataclass(frozen=True)
class PlannedPush:
    """One push: along `waypoints` to their end and back.

    Attributes:
        waypoints: (k, 3) of the tool's centre [m], the first one clear of the block.
        times: (m,) knots [s].
        arcs: (m,) arc length along the waypoints at the knots [m]. The tool starts and stops
            smoothly at each knot.
    """

    waypoints: FloatArray
    times: FloatArray
    arcs: FloatArray

    @property
    def corners(self) -> FloatArray:
        """(k,) arc length at each waypoint [m]."""
        return np.concatenate(
            [[0.0], np.cumsum(np.linalg.norm(np.diff(self.waypoints, axis=0), axis=1))]
        )

    @property
    def outwards(self) -> FloatArray:
        """(3,) unit vector opposite to the first run, out of the block."""
        way = self.waypoints[0] - self.waypoints[1]
        return np.asarray(way / np.linalg.norm(way))

    def place(self, arcs: FloatArray) -> FloatArray:
        """Tool centre (n, 3) [m] at the arc lengths (n,)."""
        return np.stack(
            [np.interp(arcs, self.corners, self.waypoints[:, axis]) for axis in range(3)], axis=-1
        )

    def shallower(self, by: float) -> PlannedPush:
        """The same push in the same time, shallower `by` [m] along its first run."""
        waypoints = (
            self.waypoints + by * self.outwards * (np.arange(len(self.waypoints)) > 0)[:, None]
        )
        return PlannedPush(waypoints, self.times, np.where(self.arcs > 0, self.arcs - by, 0.0))

    def when(self, leg: int, arcs: FloatArray) -> FloatArray:
        """Times (n,) [s] at which the tool is at arc lengths (n,) [m] between knots `leg` and
        `leg + 1`.
        """
        times = np.linspace(self.times[leg], self.times[leg + 1], 400)
        passed = self.arc(times)
        order = slice(None) if passed[0] < passed[-1] else slice(None, None, -1)
        return np.asarray(np.interp(arcs, passed[order], times[order]))

    def arc(self, times: FloatArray) -> FloatArray:
        """Arc length (n,) [m] at the times (n,) [s]."""
        return _eased(times, self.times, self.arcs)


@dataclass(frozen=True)
class MotionPlan:
    """One sequence of pushes, in the phantom frame.

    Attributes:
        name: of the sequence.
        axis: (3,) unit vector from the shaft towards the tip.
        pushes: in order of time.
        duration: [s].
    """

    name: str
    axis: FloatArray
    pushes: tuple[PlannedPush, ...]
    duration: float

    def centre(self, times: FloatArray) -> FloatArray:
        """Tool centre (n, 3) [m] at times (n,) [s]; between pushes it moves from one start to the
        next.
        """
        knots = np.concatenate([[push.times[0], push.times[-1]] for push in self.pushes])
        stops = np.repeat([push.waypoints[0] for push in self.pushes], 2, axis=0)
        centre = np.stack([_eased(times, knots, stops[:, axis]) for axis in range(3)], axis=-1)
        for push in self.pushes:
            inside = (times >= push.times[0]) & (times <= push.times[-1])
            centre[inside] = push.place(push.arc(times[inside]))
        return centre


def _eased(times: FloatArray, knots: FloatArray, values: FloatArray) -> FloatArray:
    """Interpolate with zero slope at each knot."""
    index = np.clip(np.searchsorted(knots, times, side="right") - 1, 0, len(knots) - 2)
    t = np.clip((times - knots[index]) / (knots[index + 1] - knots[index]), 0.0, 1.0)
    return np.asarray(values[index] + (values[index + 1] - values[index]) * t * t * (3 - 2 * t))


def draw_motion(
    name: str,
    number: int,
    size: tuple[float, float, float],
    tool_radius: float,
    seen: FloatArray,
    seed: int,
    rounds: int = 1,
    lean: float | None = None,
) -> MotionPlan:
    """Draw the motion of one sequence; SetupError for an unknown kind.

    Args:
        name: kind and number, as in "poke-side-02".
        number: how many sequences of its kind come before; chooses the place.
        size: of the block [m].
        tool_radius: stated [m].
        seen: (2,) signs of the x and y sides that the camera sees.
        seed: of this sequence.
        rounds: number of rounds of pushes. Each further round is at the next place; pushes from
            the side stay on one side.
        lean: angle of the shaft from the vertical, over the block, in pushes from the side [rad];
            None keeps the shaft clear of the block.
    """
    rng = np.random.default_rng([seed, *name.encode()])
    kind = name.rpartition("-")[0]
    paths: list[FloatArray] = []
    axes: list[FloatArray] = []
    for turn in range(rounds):
        if kind == "poke-top":
            touched, own = _top(rng, number + turn, size, tool_radius)
        elif kind == "poke-side":
            touched, own = _side(rng, number, size, tool_radius, seen, lean)
        elif kind == "drag":
            touched, own = _drag(rng, number + turn, size, tool_radius)
        else:
            raise SetupError(
                f"sequence {name!r} is of no known kind; known are poke-top, poke-side and drag, "
                "with -01 and so on"
            )
        paths += touched
        axes.append(own)
    return _timed(name, paths, axes[0], rng)


def _top(
    rng: np.random.Generator, number: int, size: tuple[float, float, float], radius: float
) -> tuple[list[FloatArray], FloatArray]:
    middle = np.array([(-0.017, 0.0, 0.017)[number % 3], 0.0])
    paths = []
    for depth in rng.permutation(
        [rng.uniform(3e-3, 4.5e-3), rng.uniform(5e-3, 6.5e-3), rng.uniform(7e-3, 8.5e-3)]
    ):
        place = middle + rng.uniform(-1, 1, 2) * (0.005, 0.006)
        lean = rng.uniform(-1.5e-3, 1.5e-3, 2)
        top = np.array([*place, size[2] + radius + HOVER])
        paths.append(np.array([top, [*(place + lean), size[2] + radius - depth]]))
    return paths, _tilted(rng)


def _side(
    rng: np.random.Generator,
    number: int,
    size: tuple[float, float, float],
    radius: float,
    seen: FloatArray,
    lean: float | None,
) -> tuple[list[FloatArray], FloatArray]:
    normal = int(number % 2 == 0)
    sign = float(seen[normal])
    paths = []
    for depth in rng.permutation(
        [rng.uniform(3e-3, 4.5e-3), rng.uniform(4.5e-3, 6e-3), rng.uniform(6e-3, 7e-3)]
    ):
        start = np.array([0.0, 0.0, rng.uniform(0.019, 0.027)])
        start[1 - normal] = rng.uniform(-0.25, 0.25) * size[1 - normal]
        end = start.copy()
        start[normal] = sign * (size[normal] / 2 + radius + HOVER)
        end[normal] = sign * (size[normal] / 2 + radius - depth)
        paths.append(np.array([start, end]))
    axis = np.array([0.0, 0.0, -0.74])
    axis[normal] = -0.67 * sign
    if lean is not None:
        axis[2], axis[normal] = -np.cos(lean), np.sin(lean) * sign
    return paths, axis / np.linalg.norm(axis)


def _drag(
    rng: np.random.Generator, number: int, size: tuple[float, float, float], radius: float
) -> tuple[list[FloatArray], FloatArray]:
    along = int(number % 2)
    depth = rng.uniform(3.5e-3, 5e-3)
    length = (0.018, 0.013)[along] * rng.uniform(0.9, 1.1)
    start = np.zeros(3)
    start[1 - along] = rng.uniform(-0.004, 0.004)
    start[along] = -length / 2 * (1 if rng.random() < 0.5 else -1)
    start[2] = size[2] + radius - depth
    end = start.copy()
    end[along] = -start[along]
    return [np.array([start + np.array([0.0, 0.0, depth + HOVER]), start, end])], _tilted(rng)


def _tilted(rng: np.random.Generator) -> FloatArray:
    lean = rng.uniform(-0.17, 0.17)
    axis = np.array([lean, 0.0, -1.0]) if rng.random() < 0.5 else np.array([0.0, lean, -1.0])
    return np.asarray(axis / np.linalg.norm(axis))


def _timed(
    name: str, paths: list[FloatArray], axis: FloatArray, rng: np.random.Generator
) -> MotionPlan:
    """Time the paths: over 2 s before the first push, slow and fast pushes in turn, and a long rest
    at the end.
    """
    time = 2.4 + rng.uniform(0, 0.4)
    slow = bool(rng.integers(2))
    pushes = []
    for path in paths:
        speed = rng.uniform(4.5e-3, 6.5e-3) if slow else rng.uniform(10e-3, 15e-3)
        corners = PlannedPush(path, np.zeros(1), np.zeros(1)).corners
        steps = [(0.0, 0.0)]
        for low, high in pairwise(corners):
            steps += [((high - low) / speed, high), (rng.uniform(0.5, 1.0), high)]
        for high, low in pairwise(corners[::-1]):
            steps += [((high - low) / (1.6 * speed), low)]
        durations, arcs = np.array(steps).T
        pushes.append(PlannedPush(path, time + np.cumsum(durations), arcs))
        time = float(pushes[-1].times[-1]) + rng.uniform(0.7, 1.1)
        slow = not slow
    return MotionPlan(name, axis, tuple(pushes), time + 3.0)
