"""Readings at the rim of holes in a depth image, from the cloud alone.

Where a surface mirrors a lamp, or gives a stereo camera no texture, pixels have no reading. Those
at the rim of such a hole are off by up to millimetres: the camera's windows and filters reach into
the hole and use what they find on one side of it. A hole moves with the light and the surface's
slope, so the error moves too, and looks like a deformation.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["beside_holes"]

Mask = np.ndarray[Any, np.dtype[np.bool_]]

WIDTH = 3.3
"""Radius of the circle in which readings are counted [distances between readings]."""
FULL = 0.74
"""Readings in the circle over the usual number below which a reading lies at a rim [1]. At a
straight rim it is 0.6, one reading further in 0.8."""
FEWEST = 100
"""Readings below which no rim is looked for."""
MOST_CELLS = 2000
"""Largest number of cells of the grid along each axis."""


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
    reach = WIDTH * _spacing(sights, rows)
    around = _count(sights, rows, *_grid(sights, reach), reach**2)
    rim[rows] = around < FULL * float(np.median(around))
    return rim


def _spacing(sights: FloatArray, rows: IntArray) -> float:
    """Median distance from a reading to the nearest other, over some 500 of the rows."""
    tree = cKDTree(sights, balanced_tree=False, compact_nodes=False)
    some = sights[rows[:: len(rows) // 500 + 1]]
    nearest = np.asarray(tree.query(some, k=2)[0])[:, 1]
    return float(np.median(nearest))


def _grid(sights: FloatArray, reach: float) -> tuple[IntArray, IntArray, IntArray, int]:
    """Sort readings into square cells at least `reach` wide, across the mean direction.

    Returns each reading's cell (n, 2), the rows sorted by cell (n,), where each cell starts in
    them, and the number of cells along the second axis.
    """
    ahead = sights.mean(axis=0)
    across = np.linalg.svd(ahead[None])[2][1:]
    flat = sights @ across.T
    low = flat.min(axis=0)
    width = max(reach, float(np.ptp(flat, axis=0).max()) / MOST_CELLS, 1e-9)
    cells = ((flat - low) / width).astype(np.int64)
    columns = int(cells[:, 1].max()) + 1
    number = cells[:, 0] * columns + cells[:, 1]
    sizes = np.bincount(number, minlength=columns * (int(cells[:, 0].max()) + 1))
    starts = np.concatenate([[0], np.cumsum(sizes)])
    return cells, np.argsort(number, kind="stable"), starts, columns


@njit(cache=True)
def _count(
    sights: Any, rows: Any, cells: Any, order: Any, starts: Any, columns: int, reach2: float
) -> Any:
    """Number of readings (m,) within the reach of each of the rows, itself included."""
    counts = np.zeros(len(rows), dtype=np.int64)
    lines = (len(starts) - 1) // columns
    for m in range(len(rows)):
        x, y, z = sights[rows[m]]
        i, j = cells[rows[m]]
        left, right = max(j - 1, 0), min(j + 2, columns)
        for line in range(max(i - 1, 0), min(i + 2, lines)):
            for k in range(starts[line * columns + left], starts[line * columns + right]):
                n = order[k]
                dx, dy, dz = sights[n, 0] - x, sights[n, 1] - y, sights[n, 2] - z
                counts[m] += dx * dx + dy * dy + dz * dz <= reach2
    return counts
