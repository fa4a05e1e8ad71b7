"""Distance between the tool and the resting block."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.obstacles import Shaft

__all__ = ["ToolClearance"]

_SAME = 1e-7
"""Points of the surface at most this far apart coincide [m]."""


class ToolClearance:
    """Signed distance of a ball, and of its shaft if it may touch, to a surface of points.

    The distance is negative inside the surface, so that a ball sunk by more than its diameter still
    counts as in contact. At an edge the normals of the faces are added; otherwise a point beside
    one face would count as inside of another.

    Args:
        surface: (s, 3) points [m].
        normals: (s, 3) outward normals.
        radius: of the ball [m].
        shaft: of the tool; None where it cannot touch.
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
        """Gap (n,) [m] between surface and tool with the ball's centre at (n, 3) [m]; negative in
        contact.
        """
        gap = self._distance(centres) - self._radius
        if self._shaft is None:
            return gap
        rod = self._shaft
        along = np.arange(0.0, rod.length, 0.5 * rod.radius)
        beside = self._distance(centres[:, None] + along[:, None] * rod.away)
        return np.asarray(np.minimum(gap, beside.min(axis=1) - rod.radius))

    def _distance(self, places: FloatArray) -> FloatArray:
        """Signed distance (...) [m] of points (..., 3) [m]."""
        distance, nearest = self._tree.query(places)
        ahead = np.einsum(
            "...i,...i->...", places - self._tree.data[nearest], self._normals[nearest]
        )
        return np.asarray(np.where(ahead < 0, -distance, distance))
