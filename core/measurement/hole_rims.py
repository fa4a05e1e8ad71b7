"""Readings at the rim of holes in a depth image, from the cloud alone.

Where a surface mirrors a lamp, or gives a stereo camera no texture, pixels have no reading. Those
at the rim of such a hole are off by up to millimetres: the camera's windows and filters reach into
the hole and use what they find on one side of it. A hole moves with the light and the surface's
slope, so the error moves too, and looks like a deformation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray

__all__ = ["beside_holes"]

Mask = np.ndarray[Any, np.dtype[np.bool_]]

WIDTH = 3.3
"""Radius of the circle in which readings are counted [distances between readings]."""
FULL = 0.74
"""Readings in the circle over the usual number below which a reading lies at a rim [1]. At a
straight rim it is 0.6, one reading further in 0.8."""
FEWEST = 100
"""Readings below which no rim is looked for."""


def beside_holes(sights: FloatArray, asked: Mask) -> Mask:
    """Mask (n,) of the readings that lie at the rim of a hole.

    Neither the depth nor its noise decides, so what is kept has no bias from the choice.

    Args:
        sights: directions (n, 3) from the camera to all readings of a cloud, unit vectors.
        asked: mask (n,) of the readings that are asked for; others are never at a rim.
    """
    rim = np.zeros(len(sights), dtype=bool)
    rows = np.flatnonzero(asked)
    if len(rows) < FEWEST:
        return rim
    tree = cKDTree(sights, balanced_tree=False, compact_nodes=False)
    some = sights[rows[:: len(rows) // 500 + 1]]
    nearest = np.asarray(tree.query(some, k=2)[0])[:, 1]
    around = tree.query_ball_point(
        sights[rows], WIDTH * float(np.median(nearest)), return_length=True
    )
    rim[rows] = around < FULL * float(np.median(around))
    return rim
