"""Fine triangles of the phantom's surface, for bands of colours, and its grid lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["FineSurface", "IntArray", "grid_edges", "lattice", "refine"]

IntArray = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True, eq=False)
class FineSurface:
    """A surface whose points are weighted means of coarse vertices, split along the edges of the
    box.

    Attributes:
        corners: (n, k) coarse vertices of each fine point, three or more.
        weights: (n, k) their weights; rows sum to one.
        faces: (m, 3) fine triangles, oriented as the coarse ones.
    """

    corners: IntArray
    weights: FloatArray
    faces: IntArray

    def spread(self, values: Any) -> FloatArray:
        """Interpolate values at the coarse vertices (V,) or (V, 3) to the fine points; NaN corners
        are left out.
        """
        picked = np.asarray(values, dtype=float)[self.corners]
        weights = self.weights if picked.ndim == 2 else self.weights[:, :, None]
        seen = np.isfinite(picked)
        total = np.sum(weights * seen, axis=1)
        mean = np.sum(np.where(seen, picked, 0.0) * weights, axis=1) / np.where(
            total > 0, total, 1.0
        )
        return np.where(total >= 0.5, mean, np.nan)


def refine(rest: Any, faces: Any, parts: int) -> FineSurface:
    """Cut each triangle into parts^2. Points on common edges are shared unless the faces have
    normals along different axes.
    """
    rest, faces = np.asarray(rest, dtype=float), np.asarray(faces, dtype=np.int64)
    lattice = [(i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]
    index = {place: number for number, place in enumerate(lattice)}
    weights = np.array([(parts - i - j, i, j) for i, j in lattice], dtype=float) / parts
    cells = [(index[i, j], index[i + 1, j], index[i, j + 1]) for i, j in lattice if i + j < parts]
    cells += [
        (index[i + 1, j], index[i + 1, j + 1], index[i, j + 1])
        for i, j in lattice
        if i + j < parts - 1
    ]

    corners = np.repeat(faces, len(lattice), axis=0)
    tiled = np.tile(weights, (len(faces), 1))
    fine = (np.array(cells)[None] + len(lattice) * np.arange(len(faces))[:, None, None]).reshape(
        -1, 3
    )
    side = np.repeat(_side(rest, faces), len(lattice))
    place = np.einsum("nk,nkx->nx", tiled, rest[corners])
    key = np.column_stack([np.round(place * 1e7).astype(np.int64), side])
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    return FineSurface(corners[first], tiled[first], inverse.reshape(-1)[fine])


def grid_edges(rest: Any, faces: Any) -> IntArray:
    """(e, 2) edges of the grid: the triangles' edges without the diagonals of its
    quadrilaterals.
    """
    rest, faces = np.asarray(rest, dtype=float), np.asarray(faces, dtype=np.int64)
    sides = np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1)
    lengths = np.linalg.norm(rest[sides[..., 0]] - rest[sides[..., 1]], axis=-1)
    longest = lengths >= lengths.max(axis=1, keepdims=True) - 1e-9
    edges = np.sort(sides.reshape(-1, 2), axis=1)
    unique, inverse = np.unique(edges, axis=0, return_inverse=True)
    count = np.bincount(inverse.reshape(-1))
    hypotenuses = np.bincount(inverse.reshape(-1), weights=longest.reshape(-1))
    return np.asarray(unique[~((count == 2) & (hypotenuses == 2))])


def lattice(rows: int, columns: int) -> IntArray:
    """(m, 3) triangles between points in rows, row after row."""
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
    )
    return np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _side(rest: FloatArray, faces: IntArray) -> IntArray:
    """Main direction of each rest triangle's normal, 0 to 5."""
    a, b, c = (rest[faces[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    axis = np.abs(normal).argmax(axis=1)
    return np.asarray(axis * 2 + (np.take_along_axis(normal, axis[:, None], axis=1)[:, 0] > 0))
