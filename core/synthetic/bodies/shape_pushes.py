"""Pushes over a free form: along its normal, at places that the camera sees."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush

__all__ = ["push_motion", "reachable_places", "spread_places", "timed_push"]

_HOVER, _ABOVE = 5e-3, 12e-3
"""Distance from the surface before a push, and height of the travel above everything [m]."""
_LEAST_HEIGHT = 0.4
"""Least height of a pushed place over the body's height [1]."""
_RISE: Mapping[str, tuple[float, float]] = {"poke-top": (0.85, 1.01), "poke-side": (0.5, 0.85)}
"""Least and largest height of the surface's normal, by kind of push [1]."""
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
    low, high = _RISE[kind]
    fit = (normals[:, 2] >= low) & (normals[:, 2] < high)
    fit &= places[:, 2] > _LEAST_HEIGHT * shape.height
    fit &= np.einsum("ni,ni->n", eye - places, normals) > 0
    # The ball touches at one point alone: nothing else of the body is in its way.
    centres = places + reach * normals
    fit[fit] &= shape.gap(centres[fit], reach) > -0.1 * reach
    return places[fit], normals[fit]


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
    """Plan the pushes of one sequence at places (n, 3) [m], along their outward normals (n, 3)."""
    top, time, pushes = shape.height + radius + _ABOVE, 1.2, []
    for place, normal in zip(places, normals, strict=True):
        depth = min(rng.uniform(*_DEPTH), _DEEPEST * place[2])
        hover, deep = place + (radius + _HOVER) * normal, place + (radius - depth) * normal
        way = np.array([[hover[0], hover[1], max(top, hover[2] + 1e-3)], hover, deep])
        pushes.append(timed_push(way, time, rng))
        time = float(pushes[-1].times[-1]) + rng.uniform(0.5, 0.8)
    return MotionPlan(name, np.array([0.0, 0.0, -1.0]), tuple(pushes), time + 0.8)


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
