"""Traces of a ball over the untouched surface of a free form, as a hand makes them."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.bodies.shape_pushes import spread_places

__all__ = ["draw_traces"]

_DABS = 36
"""Single contacts, spread over what the ball reaches."""
_STROKES, _STEPS, _STEP = 3, 12, 2.0e-3
"""Strokes, points of each, and their distance along it [m]."""
_PRESS, _NOISE = 1.5e-4, 1.5e-4
"""Usual depth by which the ball presses the surface in, and error of each coordinate [m]."""
_LIFTED, _LIFTS = 0.1, (2e-3, 8e-3)
"""Share of the points that are lifted off the surface [1], and by how much [m]."""
_OVERHANG = -0.1
"""Least height of the normal of a place that the ball reaches [1]."""


def draw_traces(
    shape: Shape, radius: float, random: np.random.Generator
) -> tuple[list[int], FloatArray]:
    """Draw dabs and strokes of a ball.

    Args:
        shape: the true body, as it lies.
        radius: of the ball [m].
        random: source of places, pressing, noise and lifts.

    Returns:
        number of each point's stroke, and centres of the ball (n, 3) [m], phantom frame.
    """
    places, normals = _reached(shape, radius)
    mixed = random.permutation(len(places))
    rows = [int(mixed[row]) for row in spread_places(places[mixed], _DABS)]
    strokes = list(range(_DABS))
    for number in range(_STROKES):
        begin = int(rows[int(random.integers(len(rows)))])
        way = random.normal(size=3)
        way -= normals[begin] * (way @ normals[begin])
        way /= np.linalg.norm(way)
        along = places[begin] + np.arange(_STEPS)[:, None] * _STEP * way
        nearest = np.linalg.norm(places[None] - along[:, None], axis=2).argmin(axis=1)
        rows += [int(row) for row in nearest]
        strokes += [_DABS + number] * _STEPS
    press = -np.abs(random.normal(size=len(rows))) * _PRESS
    lifted = random.uniform(size=len(rows)) < _LIFTED
    off = np.where(lifted, random.uniform(*_LIFTS, size=len(rows)), press)
    centres = places[rows] + (radius + off)[:, None] * normals[rows]
    return strokes, centres + random.normal(size=centres.shape) * _NOISE


def _reached(shape: Shape, radius: float) -> tuple[FloatArray, FloatArray]:
    """Places (n, 3) [m] that the ball touches from above or from the side, and their normals."""
    places = shape.surface_points()
    normals = shape.facing(places + 1e-6 * np.array([0.0, 0.0, 1.0]))[1]
    centres = places + radius * normals
    fit = (normals[:, 2] > _OVERHANG) & (centres[:, 2] > radius)
    fit[fit] &= shape.gap(centres[fit], radius) > -0.05 * radius
    return places[fit], normals[fit]
