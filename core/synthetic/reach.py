"""How far the tool is from the block, before anything is solved."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from core.frames import FloatArray
from core.synthetic.obstacle import Shaft

__all__ = ["Reach"]


class Reach:
    """Distances to the points of a settled surface (s, 3) [m], of a ball with this radius [m] and, if it may touch, its shaft."""

    def __init__(self, surface: FloatArray, radius: float, shaft: Shaft | None) -> None:
        self._tree = cKDTree(surface)
        self._radius = radius
        self._shaft = shaft

    def gap(self, centres: FloatArray) -> FloatArray:
        """From the tool with its ball's centre at these places (n, 3) [m] to the surface (n,) [m], negative where it presses."""
        gap = np.asarray(self._tree.query(centres)[0]) - self._radius
        if self._shaft is None:
            return gap
        rod = self._shaft
        along = np.arange(0.0, rod.length, 0.5 * rod.radius)
        beside = np.asarray(self._tree.query(centres[:, None] + along[:, None] * rod.away)[0])
        return np.asarray(np.minimum(gap, beside.min(axis=1) - rod.radius))
