"""Sensors: clock, place of the camera, and depth readings, by either law."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.synthetic.scenario.hidden_effects import HiddenEffect

__all__ = ["camera_motion", "clock_offset", "depth_curvature"]

_DRIFT = 0.2
"""Change of a clock's offset from the beginning of a sequence to its end, over the offset [1]."""
_LATER, _SETTLING = 1 / 6, 120.0
"""Share of a camera's motion that comes later [1], and the time after which 1/e of it is missing
[s]."""
_CURVING = 4.0
"""Growth of the depth's scale error with depth, over the error [1/m]."""


def clock_offset(
    hidden: HiddenEffect | None, instants: FloatArray, duration: float
) -> FloatArray | float:
    """Return the error of the camera's clock [s] at instants [s] of a sequence."""
    if hidden is None:
        return 0.0
    offset = hidden.value("offset")
    if not hidden.second_law:
        return offset
    return np.asarray(offset * (1.0 + _DRIFT * (instants / duration - 0.5)))


def camera_motion(hidden: HiddenEffect | None, whole: Transform, time: float) -> Transform:
    """Return the camera's motion since the rest cloud.

    Args:
        hidden: the motion's sizes; None without.
        whole: the motion in the end.
        time: since the rest cloud [s].
    """
    if hidden is None or not hidden.second_law:
        return whole
    share = 1.0 - _LATER * np.exp(-time / _SETTLING)
    return Transform.from_vector(share * whole.translation, share * whole.rotation_vector)


def depth_curvature(hidden: HiddenEffect | None) -> float:
    """Return the error of a depth reading over the squared distance from 0.35 m [1/m]."""
    if hidden is None or not hidden.second_law:
        return 0.0
    return _CURVING * (hidden.value("scale") - 1.0)
