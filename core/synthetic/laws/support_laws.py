"""Support of the base: detachment, compliance and sliding friction, by either law."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.scenario.hidden_effects import HiddenEffect

__all__ = ["is_bonded", "side_of", "slip_limit", "spring_factor"]

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]

_MIDDLE, _BENT = 1.3, 0.9
"""Extent of a parabolic front in the middle over the mean, and its fall towards the corners [1]."""
_UNEVEN = 0.5
"""Share by which a support is stiffer or softer at its ends [1]."""
_PRESSURE_POWER, _USUAL_LOAD = 0.85, 2.0
"""Power of the pressure, and load over the block's weight at which both laws agree [1]."""


def side_of(name: str) -> tuple[int, float]:
    """Return axis and sign of a side named like "-x"."""
    return "xy".index(name[1]), -1.0 if name[0] == "-" else 1.0


def is_bonded(
    hidden: HiddenEffect | None, places: FloatArray, size: tuple[float, float, float]
) -> BoolArray:
    """Return the mask (...) of places (..., 3) [m] of the base that are not detached.

    Args:
        hidden: the detachment; None without.
        places: on the base.
        size: of the block [m].
    """
    if hidden is None:
        return np.ones(places.shape[:-1], dtype=bool)
    axis, sign = side_of(str(hidden.parameters["edge"]))
    extent: FloatArray | float = hidden.value("extent")
    if hidden.second_law:
        along = 2.0 * places[..., 1 - axis] / size[1 - axis]
        extent = extent * (_MIDDLE - _BENT * along**2)
    return np.asarray(size[axis] / 2 - sign * places[..., axis] >= extent - 1e-9)


def spring_factor(
    hidden: HiddenEffect, places: FloatArray, size: tuple[float, float, float]
) -> FloatArray | float:
    """Return the factor [1] on the support's stiffness at places (..., 3) [m] of the base."""
    if not hidden.second_law:
        return 1.0
    return np.asarray(1.0 + _UNEVEN * 2.0 * places[..., 0] / size[0])


def slip_limit(hidden: HiddenEffect, pressed: float, weight: float) -> float:
    """Return the largest force along the table [N] that friction holds.

    Args:
        hidden: the friction.
        pressed: force on the table [N].
        weight: of the block [N].
    """
    limit = hidden.value("friction_coefficient") * max(pressed, 0.0)
    if not hidden.second_law or pressed <= 0.0:
        return limit
    return float(limit * (pressed / (_USUAL_LOAD * weight)) ** (_PRESSURE_POWER - 1.0))
