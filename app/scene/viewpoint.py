"""From where the phantom is looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["FIELD_OF_VIEW", "LOOKS", "Direction", "Viewpoint", "lookout"]

Direction = Literal["reset", "top", "front", "side"]
LOOKS: tuple[Direction, ...] = get_args(Direction)
FIELD_OF_VIEW = 0.6
RAISED = np.deg2rad(36.0)
ROOM = 1.2


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """Where the camera is, what it looks at (3,) [m], and its upright (3,)."""

    position: FloatArray
    target: FloatArray
    up: FloatArray


def lookout(
    size: FloatArray,
    eye: FloatArray,
    columns: Sequence[tuple[float, float, float]],
    where: Direction,
) -> Viewpoint:
    """A camera that sees the whole phantom of edge lengths (3,) [m], and all its columns where it
    stands more than once.

    `reset` is the depth camera's side, (3,) [m], raised to a comfortable height; from the `top` x
    is to the right; the `front` is seen along +y, the `side` along -x.
    """
    around = np.arctan2(eye[1], eye[0])
    directions = {
        "reset": (np.cos(RAISED) * np.cos(around), np.cos(RAISED) * np.sin(around), np.sin(RAISED)),
        # A camera right above has no upright of its own: it leans by a hair.
        "top": (0.0, -1e-3, 1.0),
        "front": (0.0, -1.0, 0.0),
        "side": (1.0, 0.0, 0.0),
    }
    shifts = np.array(columns)
    centre = shifts.mean(axis=0) + np.array([0.0, 0.0, 0.52 * size[2]])
    reach = float(np.linalg.norm(size) + np.ptp(shifts, axis=0).max()) / 2
    away = np.array(directions[where]) * reach / np.sin(FIELD_OF_VIEW / 2) * ROOM
    return Viewpoint(centre + away, centre, np.array([0.0, 0.0, 1.0]))
