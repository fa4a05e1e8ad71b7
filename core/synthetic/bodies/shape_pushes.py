"""Pushes over a free form: along its normal, at places that the camera sees."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush

__all__ = [
    "is_upright",
    "on_one_side",
    "push_motion",
    "reachable_places",
    "spread_places",
    "timed_push",
]

_HOVER, _ABOVE = 5e-3, 12e-3
"""Distance from the surface before a push, and height of the travel above everything [m]."""
_LEAST_HEIGHT = 0.4
"""Least height of a pushed place over the body's height [1]."""
_RISE: Mapping[str, tuple[float, float]] = {"poke-top": (0.85, 1.01), "poke-side": (0.5, 0.85)}
"""Least and largest height of the surface's normal, by kind of push [1]."""
_UPRIGHT, _FEW_SLOPES = (-0.1, 0.5), 6
"""The same for an upright side, and number of places on slopes below which upright sides are
pushed."""
_LEAN = np.arctan2(0.67, 0.74)
"""Angle of the shaft from the vertical, away from an upright side [rad]."""
_ONE_SIDE = 0.7
"""Least cosine between normals of places that one leaning tool reaches [1]."""
_DEPTH, _DEEPEST = (5e-3, 8e-3), 0.3
"""Depth of a push [m], and largest depth over the height of the place [1]."""


def reachable_places(
    shape: Shape, kind: str, eye: FloatArray, reach: float
) -> tuple[FloatArray, FloatArray]:
    """Places (n, 3) [m] for one kind of push, and outward normals (n, 3).

    Args:
        shape: the stated body.
        kind: poke-top or poke-side.
        eye: (3,) of the camera [m], which must see the tool there.
        reach: radius of the tool [m].
    """
    places = shape.surface_points()
    normals = shape.facing(places + 1e-6 * np.array([0.0, 0.0, 1.0]))[1]
    fit = places[:, 2] > _LEAST_HEIGHT * shape.height
    fit &= np.einsum("ni,ni->n", eye - places, normals) > 0
    # The ball touches at one point alone: nothing else of the body is in its way.
    centres = places + reach * normals
    fit[fit] &= shape.gap(centres[fit], reach) > -0.1 * reach
    own = fit & _rises(normals, _RISE[kind])
    if kind == "poke-side" and own.sum() < _FEW_SLOPES:
        own = fit & _rises(normals, _UPRIGHT)
    return places[own], normals[own]


def _rises(normals: FloatArray, within: tuple[float, float]) -> np.ndarray[Any, np.dtype[np.bool_]]:
    return np.asarray((normals[:, 2] >= within[0]) & (normals[:, 2] < within[1]))


def is_upright(normals: FloatArray) -> bool:
    """Whether the surface with normals (n, 3) is pushed by a leaning tool."""
    return bool((normals[:, 2] < _UPRIGHT[1]).any())


def on_one_side(normals: FloatArray, row: int) -> IntArray:
    """Rows of normals (n, 3) that one leaning tool reaches with that of `row`."""
    return np.flatnonzero(normals @ normals[row] > _ONE_SIDE)


def spread_places(places: FloatArray, count: int) -> list[int]:
    """Rows of `count` of the places (n, 3) far apart: each next one farthest from those before
    (Gonzalez 1985).
    """
    chosen = [0]
    away = np.linalg.norm(places - places[0], axis=1)
    while len(chosen) < min(count, len(places)):
        chosen.append(int(away.argmax()))
        away = np.minimum(away, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return chosen


def push_motion(
    name: str,
    shape: Shape,
    places: FloatArray,
    normals: FloatArray,
    radius: float,
    rng: np.random.Generator,
) -> MotionPlan:
    """Plan the pushes of one sequence at places (n, 3) [m], along their outward normals (n, 3).

    The tool hangs from above; before an upright side it leans away from it.
    """
    top, time, pushes = shape.height + radius + _ABOVE, 1.2, []
    for place, normal in zip(places, normals, strict=True):
        depth = min(rng.uniform(*_DEPTH), _DEEPEST * place[2])
        hover, deep = place + (radius + _HOVER) * normal, place + (radius - depth) * normal
        way = np.array([[hover[0], hover[1], max(top, hover[2] + 1e-3)], hover, deep])
        pushes.append(timed_push(way, time, rng))
        time = float(pushes[-1].times[-1]) + rng.uniform(0.5, 0.8)
    return MotionPlan(name, _shaft(normals), tuple(pushes), time + 0.8)


def _shaft(normals: FloatArray) -> FloatArray:
    """Unit vector (3,) from the shaft to the tip, for pushes along these normals (n, 3)."""
    if not is_upright(normals):
        return np.array([0.0, 0.0, -1.0])
    away = normals[:, :2].mean(axis=0)
    return np.array([*(-np.sin(_LEAN) * away / np.linalg.norm(away)), -np.cos(_LEAN)])


def timed_push(way: FloatArray, begin: float, rng: np.random.Generator) -> PlannedPush:
    """Time a push: fast to the stop before the surface, slowly in, a hold, and back."""
    arcs = PlannedPush(way, np.zeros(1), np.zeros(1)).corners
    hover, deep = float(arcs[-2]), float(arcs[-1])
    steps = [(0.0, 0.0)]
    if hover > 0:
        steps += [(hover / 40e-3 + 0.2, hover), (0.3, hover)]
    steps += [((deep - hover) / rng.uniform(5e-3, 8e-3), deep), (rng.uniform(0.7, 0.9), deep)]
    steps += [((deep - hover) / 10e-3, hover)]
    if hover > 0:
        steps += [(hover / 40e-3 + 0.2, 0.0)]
    durations, stops = np.array(steps).T
    return PlannedPush(way, begin + np.cumsum(durations), stops)
