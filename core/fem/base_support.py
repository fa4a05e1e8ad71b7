"""The bond between a base and its support."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Detachment, Shape, Support

__all__ = ["BOND_STIFFNESS", "base_can_move", "held_share"]

BOND_STIFFNESS = 2e4
"""Stiffness over E of the bond of a base that is not simply fixed [1/m]."""
_BOND_EDGE = 1e-3
"""Width over which a bond ends at a detached strip's edge [m], so that the result changes smoothly
with the strip's extent."""


def held_share(
    detached: tuple[Detachment, ...], body: Box | Shape, points: FloatArray
) -> FloatArray:
    """Share of the bond (0 to 1) left at base points (..., 3) [m]."""
    held = np.ones(points.shape[:-1])
    for strip in detached:
        axis, sign = "xy".index(strip.edge[1]), -1 if strip.edge[0] == "-" else 1
        inwards = sign * ((body.low if sign < 0 else body.high)[axis] - points[..., axis])
        held *= 0.5 * (1 + np.tanh((inwards - strip.extent) / _BOND_EDGE))
    return held


def base_can_move(support: Support) -> bool:
    """Whether the base can move against its support."""
    return bool(support.detached) or support.stiffness_over_E is not None
