"""Material from place to place and by direction, by either law of each effect."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.scenario.disturbance import Disturbance
from palpate.synthetic.scenario.hidden_effects import HiddenEffect

__all__ = [
    "beyond_inclusion",
    "beyond_tube",
    "fibre_families",
    "gradient_factor",
    "in_inclusion",
    "in_tube",
    "layer_factor",
    "points_along",
    "tube_axis",
    "uneven_density",
    "uneven_poisson_ratio",
    "wave_factor",
]

_HALF_AXES = np.array([1.25, 0.85, 0.94])
"""Half axes of an ellipsoid over the radius of a ball of the same volume [1]."""
_TAPER, _TAPERED = 0.2, 30e-3
"""Share by which a tube grows [1] over this way from its middle, and shrinks the other way [m]."""
_STRAIGHT = 1e-3
"""Curvature below which a tube counts as straight [1/m]."""
_FADING = 0.5
"""Depth below a layer in which its stiffness falls to 1/e, over its thickness [1]."""
_RISE = 0.04
"""Rise of Poisson's ratio from bottom to top [1]."""
_HEAVIER = 0.6
"""Density of the bottom over that of the top, less one [1]."""
_FAMILIES = np.deg2rad(20.0)
"""Angle of two families of fibres from their mean direction [rad]."""


def in_inclusion(hidden: HiddenEffect, places: FloatArray) -> FloatArray:
    """Return whether each of the places (..., 3) [m] is in the inclusion."""
    away = places - [hidden.value(axis) for axis in "xyz"]
    if hidden.second_law:
        away = away / _HALF_AXES
    return np.asarray(np.linalg.norm(away, axis=-1) < hidden.value("radius"))


def beyond_inclusion(hidden: HiddenEffect, places: FloatArray) -> FloatArray:
    """Return the distance (...) [m] of places (..., 3) [m] from the surface of the ball."""
    away = places - [hidden.value(axis) for axis in "xyz"]
    return np.asarray(np.linalg.norm(away, axis=-1) - hidden.value("radius"))


def _frame(hidden: HiddenEffect, middle: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a tube's point beside the body's middle (3,) [m], its direction there (3,), and its
    curvature (3,) [1/m].
    """
    heading, slope = hidden.value("heading"), np.tan(hidden.value("inclination"))
    way = np.array([np.cos(heading), np.sin(heading), slope])
    left = np.array([-way[1], way[0], 0.0])
    point = np.array([*middle, hidden.value("z")]) + hidden.value("aside") * left
    turn = hidden.value("bend") * left + np.array([0.0, 0.0, hidden.value("sag")])
    along = way / np.linalg.norm(way)
    return point, along, (turn - (turn @ along) * along) / (way @ way)


def tube_axis(hidden: HiddenEffect, middle: FloatArray, way: FloatArray) -> FloatArray:
    """Return points (k, 3) [m] of a tube's axis, an arc of a circle.

    Args:
        hidden: the tube.
        middle: (x, y) of the body's bounding box [m].
        way: (k,) along the arc from the point nearest to the middle [m].
    """
    point, along, turn = _frame(hidden, middle)
    curvature = float(np.linalg.norm(turn))
    if curvature < _STRAIGHT:
        return np.asarray(point + np.outer(way, along))
    angle = curvature * way
    return np.asarray(
        point
        + np.outer(np.sin(angle) / curvature, along)
        + np.outer((1.0 - np.cos(angle)) / curvature**2, turn)
    )


def beyond_tube(hidden: HiddenEffect, places: FloatArray, middle: FloatArray) -> FloatArray:
    """Return the distance (...) [m] of places (..., 3) [m] from the surface of a tube.

    The axis is an arc of a circle, of the stated direction and curvature where it is nearest to the
    middle (x, y) [m] of the body's bounding box. By the second law the tube tapers.
    """
    point, along, turn = _frame(hidden, middle)
    away = places - point
    way, curvature = away @ along, float(np.linalg.norm(turn))
    if curvature < _STRAIGHT:
        apart = np.linalg.norm(away - way[..., None] * along, axis=-1)
    else:
        inwards, across = turn / curvature, np.cross(along, turn / curvature)
        round_ = np.hypot(way, away @ inwards - 1.0 / curvature) - 1.0 / curvature
        apart = np.hypot(round_, away @ across)
    taper = _TAPER * np.clip(way / _TAPERED, -1.0, 1.0) if hidden.second_law else 0.0
    return np.asarray(apart - hidden.value("radius") * (1.0 + taper))


def in_tube(hidden: HiddenEffect, places: FloatArray, middle: FloatArray) -> FloatArray:
    """Return whether each of the places (..., 3) [m] is in the tube; arguments as `beyond_tube`."""
    return np.asarray(beyond_tube(hidden, places, middle) < 0)


def points_along(hidden: HiddenEffect, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return points (k, 3) [m] of a tube's axis a radius apart, within a bounding box.

    Args:
        hidden: the tube.
        low: lowest corner (3,) of the body's bounding box [m].
        high: highest corner (3,) [m].
    """
    end = float(np.linalg.norm(high - low)) / 2
    points = tube_axis(hidden, (low + high)[:2] / 2, np.arange(-end, end, hidden.value("radius")))
    return np.asarray(points[((points > low) & (points < high)).all(axis=1)])


def layer_factor(hidden: HiddenEffect, depth: FloatArray) -> FloatArray:
    """Return the factor [1] on stiffness at depths [m] below the top."""
    thickness, ratio = hidden.value("thickness"), hidden.value("stiffness_ratio")
    inside = depth < thickness
    if not hidden.second_law:
        return np.where(inside, ratio, 1.0)
    below = np.exp(-np.maximum(depth - thickness, 0.0) / (_FADING * thickness))
    return np.asarray(ratio**below)


def gradient_factor(hidden: HiddenEffect, height: FloatArray) -> FloatArray:
    """Return the factor [1] on stiffness at heights over the block's [1].

    Both laws have the same ratio of top to bottom. The linear one has a mean of one.
    """
    ratio = hidden.value("log_ratio")
    if not hidden.second_law:
        return np.asarray(np.exp(ratio * (height - 0.5)))
    return np.asarray(1.0 + 2.0 * np.tanh(0.5 * ratio) * (height - 0.5))


def wave_factor(waves: Disturbance, places: FloatArray) -> FloatArray:
    """Return the factor (...) [1] on stiffness at places (..., 3) [m], by waves in the plane."""
    turn = waves.value("direction")
    way = places[..., :2] @ np.array([np.cos(turn), np.sin(turn)])
    angle = 2 * np.pi * way / waves.value("period") + waves.value("phase")
    return np.asarray(np.exp(waves.value("amplitude") * np.sin(angle)))


def uneven_poisson_ratio(hidden: HiddenEffect | None, height: FloatArray) -> FloatArray | float:
    """Return what is added to Poisson's ratio [1] at heights over the block's [1]."""
    if hidden is None or not hidden.second_law:
        return 0.0
    return np.asarray(_RISE * (height - 0.5))


def uneven_density(hidden: HiddenEffect, height: FloatArray) -> FloatArray | float:
    """Return the factor [1] on the weight at heights over the block's [1]."""
    if not hidden.second_law:
        return 1.0
    return np.asarray((1.0 + _HEAVIER * (1.0 - height)) / (1.0 + 0.5 * _HEAVIER))


def fibre_families(hidden: HiddenEffect | None) -> FloatArray | None:
    """Return the unit vectors (k, 3) of families of fibres; None without fibres."""
    if hidden is None:
        return None
    angle = hidden.value("direction")
    angles = np.array([angle - _FAMILIES, angle + _FAMILIES] if hidden.second_law else [angle])
    return np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)
