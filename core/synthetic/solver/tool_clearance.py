"""How far the tool is from the block, before anything is solved."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.obstacles import Shaft

__all__ = ["Reach"]

_SAME = 1e-7
"""Points of the surface that are no farther apart are one [m]."""


class Reach:
    """Distances to the points of a settled surface (s, 3) [m], of a ball with this radius [m] and,
    if it may touch, its shaft.

    They count negative within the surface, whose outward `normals` (s, 3) tell: a ball that is sunk
    by more than its diameter presses still. At an edge the faces' normals are added, so that
    nothing beside one face passes for what is under another.
    """

    def __init__(
        self, surface: FloatArray, normals: FloatArray, radius: float, shaft: Shaft | None
    ) -> None:
        self._tree = cKDTree(surface)
        self._normals = np.array(
            [normals[same].sum(axis=0) for same in self._tree.query_ball_point(surface, _SAME)]
        )
        self._radius = radius
        self._shaft = shaft

    def gap(self, centres: FloatArray) -> FloatArray:
        """From the tool with its ball's centre at these places (n, 3) [m] to the surface (n,) [m],
        negative where it presses.
        """
        gap = self._distance(centres) - self._radius
        if self._shaft is None:
            return gap
        rod = self._shaft
        along = np.arange(0.0, rod.length, 0.5 * rod.radius)
        beside = self._distance(centres[:, None] + along[:, None] * rod.away)
        return np.asarray(np.minimum(gap, beside.min(axis=1) - rod.radius))

    def _distance(self, places: FloatArray) -> FloatArray:
        """(...) [m] of places (..., 3)."""
        distance, nearest = self._tree.query(places)
        ahead = np.einsum(
            "...i,...i->...", places - self._tree.data[nearest], self._normals[nearest]
        )
        return np.asarray(np.where(ahead < 0, -distance, distance))
