"""Material from place to place and by direction, by either law of each effect."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.scenario.hidden_effects import HiddenEffect

__all__ = [
    "fibre_families",
    "gradient_factor",
    "in_inclusion",
    "layer_factor",
    "uneven_density",
    "uneven_poisson_ratio",
]

_HALF_AXES = np.array([1.25, 0.85, 0.94])
"""Half axes of an ellipsoid over the radius of a ball of the same volume [1]."""
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
