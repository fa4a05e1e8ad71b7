"""Viewpoints from which the whole phantom is visible."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["FIELD_OF_VIEW", "Direction", "Viewpoint", "viewpoint_for"]

Direction = Literal["reset", "top", "front", "side"]
FIELD_OF_VIEW = 0.6
"""Vertical field of view [rad]."""
RAISED = np.deg2rad(36.0)
"""Elevation of the camera above the table [rad]."""
ROOM = 1.2
"""Distance of the camera over the one at which the phantom fills the view [1]."""


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Position of the camera and its target (3,) [m], and its upward direction (3,)."""

    position: FloatArray
    target: FloatArray
    up: FloatArray


def viewpoint_for(
    low: FloatArray,
    high: FloatArray,
    eye: FloatArray,
    columns: Sequence[tuple[float, float, float]],
    where: Direction,
) -> Viewpoint:
    """A viewpoint from which the phantom is visible, or all its copies.

    Args:
        low: lowest corner of the phantom's bounds (3,) [m].
        high: highest corner (3,) [m].
        eye: position of the depth camera (3,) [m].
        columns: offset of each copy [m].
        where: `reset` is the depth camera's side, raised; at the `top` x is to the right; the
            `front` is seen along +y, the `side` along -x.
    """
    size, middle = high - low, (low + high) / 2
    around = np.arctan2(eye[1] - middle[1], eye[0] - middle[0])
    directions = {
        "reset": (np.cos(RAISED) * np.cos(around), np.cos(RAISED) * np.sin(around), np.sin(RAISED)),
        # Slightly inclined: the upward direction of a vertical view is undefined.
        "top": (0.0, -1e-3, 1.0),
        "front": (0.0, -1.0, 0.0),
        "side": (1.0, 0.0, 0.0),
    }
    shifts = np.array(columns)
    centre = shifts.mean(axis=0) + middle + np.array([0.0, 0.0, 0.02 * size[2]])
    reach = float(np.linalg.norm(size) + np.ptp(shifts, axis=0).max()) / 2
    away = np.array(directions[where]) * reach / np.sin(FIELD_OF_VIEW / 2) * ROOM
    return Viewpoint(centre + away, centre, np.array([0.0, 0.0, 1.0]))
