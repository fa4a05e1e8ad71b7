"""Interpolation of nodal fields, in compiled loops.

NumPy would need arrays of every node of every point.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray

__all__ = ["grid_shapes", "neighbourhood_means", "patch_rows", "weighted_nodes"]


@njit(cache=True)
def weighted_nodes(nodes: Any, weights: Any, field: Any) -> FloatArray:
    """Weighted sums (m, c) of a nodal field over each point's nodes.

    Args:
        nodes: (m, a).
        weights: (m, a).
        field: (n, c).
    """
    result = np.zeros((nodes.shape[0], field.shape[1]))
    for m in range(nodes.shape[0]):
        for a in range(nodes.shape[1]):
            for c in range(field.shape[1]):
                result[m, c] += weights[m, a] * field[nodes[m, a], c]
    return result


@njit(cache=True)
def grid_shapes(first: Any, along: Any, nx: int, ny: int) -> tuple[Any, Any]:
    """Nodes and weights (m, s^3) of points in the hexahedra of a structured grid.

    Args:
        first: (3, m) first node of each point's element along x, y, z.
        along: (3, s, m) shape functions along the axes.
        nx: nodes along x.
        ny: nodes along y.
    """
    steps, count = along.shape[1], first.shape[1]
    nodes, weights = np.empty((count, steps**3), dtype=np.int64), np.empty((count, steps**3))
    for m in range(count):
        a = 0
        for dz in range(steps):
            for dy in range(steps):
                row = ((first[2, m] + dz) * ny + first[1, m] + dy) * nx + first[0, m]
                for dx in range(steps):
                    nodes[m, a] = row + dx
                    weights[m, a] = along[0, dx, m] * along[1, dy, m] * along[2, dz, m]
                    a += 1
    return nodes, weights


@njit(cache=True)
def patch_rows(
    nodes: Any, weights: Any, normals: Any, ends: Any, count: int
) -> tuple[FloatArray, Any, Any]:
    """Sparse matrix (p, 3 count) of the sums over each patch's points of weight times normal.

    Args:
        nodes: (m, a) of the points, patch by patch.
        weights: (m, a).
        normals: (m, 3).
        ends: the points of patch i are ends[i] to ends[i + 1].
        count: number of nodes.

    Returns:
        entries, columns and row ends of the matrix in CSR form.
    """
    room = nodes.size
    entries, columns, rows = (
        np.empty(3 * room),
        np.empty(3 * room, dtype=np.int64),
        np.zeros(len(ends), dtype=np.int64),
    )
    place, used = np.full(count, -1, dtype=np.int64), 0
    for row in range(len(ends) - 1):
        begin = used
        for m in range(ends[row], ends[row + 1]):
            for a in range(nodes.shape[1]):
                node = nodes[m, a]
                if place[node] < begin:
                    place[node] = used
                    for i in range(3):
                        entries[used + i], columns[used + i] = 0.0, 3 * node + i
                    used += 3
                for i in range(3):
                    entries[place[node] + i] += weights[m, a] * normals[m, i]
        rows[row + 1] = used
    return entries[:used].copy(), columns[:used].copy(), rows


def neighbourhood_means(
    places: FloatArray, points: FloatArray, values: FloatArray, reach: float, least: int
) -> FloatArray:
    """Mean (m,) of the values of all points near each place; NaN if there are too few.

    Args:
        places: (m, 3).
        points: (n, 3).
        values: (n,) at the points.
        reach: distance up to which a point counts.
        least: smallest number of points.
    """
    if not len(points):
        return np.full(len(places), np.nan)
    low = points.min(axis=0)
    cells = ((points - low) / reach).astype(np.int64)
    shape = cells.max(axis=0) + 1
    number = (cells[:, 0] * shape[1] + cells[:, 1]) * shape[2] + cells[:, 2]
    order = np.argsort(number, kind="stable")
    begins = np.searchsorted(number[order], np.arange(shape.prod() + 1))
    return np.asarray(
        _means(places, points[order], values[order], begins, low, shape, reach, least)
    )


@njit(cache=True)
def _means(
    places: Any,
    points: Any,
    values: Any,
    begins: Any,
    low: Any,
    shape: Any,
    reach: float,
    least: int,
) -> Any:
    """Kernel of `neighbourhood_means`.

    The points are sorted by cubic cells as wide as the reach, those of cell i from begins[i] to
    begins[i + 1].
    """
    result, first, last = (
        np.full(len(places), np.nan),
        np.empty(3, dtype=np.int64),
        np.empty(3, dtype=np.int64),
    )
    for m in range(len(places)):
        for i in range(3):
            cell = int(np.floor((places[m, i] - low[i]) / reach))
            first[i], last[i] = max(cell - 1, 0), min(cell + 2, shape[i])
        if last[2] <= first[2]:
            continue
        total, count = 0.0, 0
        for x in range(first[0], last[0]):
            for y in range(first[1], last[1]):
                row = (x * shape[1] + y) * shape[2]
                for n in range(begins[row + first[2]], begins[row + last[2]]):
                    far = 0.0
                    for i in range(3):
                        far += (places[m, i] - points[n, i]) ** 2
                    if far < reach * reach:
                        total += values[n]
                        count += 1
        if count >= least:
            result[m] = total / count
    return result
