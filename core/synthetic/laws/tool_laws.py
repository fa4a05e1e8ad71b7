"""The tool: offset, compliance of its shaft, and friction of its surface, by either law."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.scenario.hidden_effects import HiddenEffect

__all__ = ["drag_limits", "offset_at", "shaft_softness"]

_GROWTH = 0.2
"""Growth of an offset from the block's middle to its end, over the offset [1]."""
_ALONG = 0.25
"""Compliance of a bending shaft along its axis over that across [1]."""
_SOFTENING = 1.0
"""Pressure at which the drag is half of Coulomb's, over Young's modulus [1]."""


def offset_at(hidden: HiddenEffect | None, centre: FloatArray, length: float) -> FloatArray:
    """Return true minus stated place (..., 3) [m] of a tool at stated centres (..., 3) [m].

    Args:
        hidden: the offset; None without.
        centre: phantom frame.
        length: of the block along x [m].
    """
    if hidden is None:
        return np.zeros(3)
    offset = np.array([hidden.value(name) for name in ("dx", "dy", "dz")])
    if not hidden.second_law:
        return offset
    return np.asarray(offset * (1.0 + _GROWTH * 2.0 * centre[..., :1] / length))


def shaft_softness(
    hidden: HiddenEffect | None, modulus: float, axis: FloatArray | None
) -> FloatArray | float:
    """Return the compliance of the shaft [m/N]: one for all directions, or a matrix (3, 3).

    Args:
        hidden: the compliance; None without.
        modulus: Young's modulus of the block [Pa].
        axis: (3,) unit vector along the shaft; None where it is not known.
    """
    if hidden is None:
        return 0.0
    softness = hidden.value("compliance_times_stiffness") / modulus
    if not hidden.second_law or axis is None:
        return softness
    return np.asarray(softness * (np.eye(3) - (1.0 - _ALONG) * np.outer(axis, axis)))


def drag_limits(hidden: HiddenEffect, pressure: FloatArray, modulus: float) -> FloatArray:
    """Return the largest tangential stress [Pa] at contact points.

    Args:
        hidden: the friction.
        pressure: at the points [Pa].
        modulus: Young's modulus of the block [Pa].
    """
    limits = hidden.value("friction_coefficient") * pressure
    if not hidden.second_law:
        return np.asarray(limits)
    return np.asarray(limits / (1.0 + pressure / (_SOFTENING * modulus)))
