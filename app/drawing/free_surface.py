"""The free surface of a body at rest as one mesh: its border, its closure, and its heights."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from palpate.app.drawing.surface_bands import IntArray
from palpate.foundation.arrays import FloatArray

__all__ = ["FreeSurface", "HeightMap", "creases"]

SAME = 1e-6
"""Vertices closer than this are one [m]."""
MOST_CELLS = 96
"""Cells of a height map along the longer edge."""
FINEST = 7.5e-4
"""Least edge length of a cell of a height map [m]."""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Height of a surface above the table, seen from above.

    Attributes:
        corner: (2,) x and y of the first cell's middle [m].
        spacing: edge length of a cell [m].
        heights: (rows along y, columns along x) [m]; NaN where there is no surface.
    """

    corner: FloatArray
    spacing: float
    heights: FloatArray


@dataclass(frozen=True, eq=False)
class FreeSurface:
    """The free surface of a body at rest; sides that meet in an edge share its vertices.

    Attributes:
        vertices: (v, 3) [m].
        faces: (t, 3) triangles, counter-clockwise from outside.
    """

    vertices: FloatArray
    faces: IntArray

    @classmethod
    def of(cls, rest: Any, faces: Any) -> Self:
        """Join the sides of a recording's surface: vertices `rest` (n, 3) [m], triangles (t, 3)."""
        places = np.asarray(rest, dtype=float)
        _, first, inverse = np.unique(
            np.round(places / SAME).astype(np.int64), axis=0, return_index=True, return_inverse=True
        )
        joined = inverse.reshape(-1)[np.asarray(faces, dtype=np.int64)]
        flat = (joined == np.roll(joined, 1, axis=1)).any(axis=1)
        return cls(places[first], joined[~flat])

    @cached_property
    def border(self) -> tuple[IntArray, FloatArray]:
        """Edges (e, 2) of a single triangle each, in its direction and one after the other around
        each hole, and the triangles' outward normals (e, 3). Beyond them the body is held.
        """
        edges = np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
        _, inverse, uses = np.unique(
            np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        single = np.flatnonzero(uses[inverse.reshape(-1)] == 1)
        single = single[_in_a_row(edges[single])]
        return edges[single], _normals(self.vertices, self.faces)[single // 3]

    @cached_property
    def closed(self) -> tuple[FloatArray, IntArray]:
        """Vertices [m] and triangles of the surface with each hole closed by a fan around its
        middle; that of a flat base lies in it.
        """
        edges, _ = self.border
        if not len(edges):
            return self.vertices, self.faces
        count = len(self.vertices)
        graph = coo_array((np.ones(len(edges)), edges.T), shape=(count, count))
        hole = connected_components(graph, directed=False)[1][edges[:, 0]]
        _, number = np.unique(hole, return_inverse=True)
        ends = self.vertices[edges].mean(axis=1)
        sums = np.stack([np.bincount(number, ends[:, axis]) for axis in range(3)], axis=1)
        middles = sums / np.bincount(number)[:, None]
        fans = np.column_stack([edges[:, 1], edges[:, 0], count + number])
        return np.concatenate([self.vertices, middles]), np.concatenate([self.faces, fans])

    @cached_property
    def height_map(self) -> HeightMap:
        """Highest points of the surface in cells of the table."""
        low, high = self.vertices[:, :2].min(axis=0), self.vertices[:, :2].max(axis=0)
        spacing = max(FINEST, float((high - low).max()) / MOST_CELLS)
        edges = self.vertices[self.faces] - self.vertices[np.roll(self.faces, 1, axis=1)]
        parts = int(np.clip(np.ceil(2 * np.linalg.norm(edges, axis=-1).max() / spacing), 1, 12))
        shares = np.array(
            [(parts - i - j, i, j) for i in range(parts + 1) for j in range(parts + 1 - i)]
        )
        points = np.einsum("nk,tki->tni", shares / parts, self.vertices[self.faces]).reshape(-1, 3)
        cells = np.floor((points[:, :2] - low) / spacing + 1e-9).astype(np.int64)
        columns, rows = cells.max(axis=0) + 1
        heights = np.full((rows, columns), -np.inf)
        np.maximum.at(heights, (cells[:, 1], cells[:, 0]), points[:, 2])
        return HeightMap(
            low + spacing / 2, spacing, np.where(np.isfinite(heights), heights, np.nan)
        )


def creases(vertices: FloatArray, faces: Any, angle: float) -> FloatArray:
    """Ends (e, 2, 3) [m] of the edges at which two triangles meet at more than an angle [rad]."""
    surface = FreeSurface.of(vertices, faces)
    edges = np.stack([surface.faces, np.roll(surface.faces, -1, axis=1)], axis=-1).reshape(-1, 2)
    ordered = np.sort(edges, axis=1)
    order = np.lexsort(ordered.T)
    pairs = np.flatnonzero((ordered[order[:-1]] == ordered[order[1:]]).all(axis=1))
    one, other = order[pairs], order[pairs + 1]
    normals = _normals(surface.vertices, surface.faces)
    across = np.einsum("ei,ei->e", normals[one // 3], normals[other // 3])
    return np.asarray(surface.vertices[edges[one[across < np.cos(angle)]]])


def _in_a_row(edges: IntArray) -> IntArray:
    """Numbers (e,) of directed edges (e, 2) of closed lines, each followed by the next one."""
    leaving: dict[int, list[int]] = {}
    for number, begin in enumerate(edges[:, 0].tolist()):
        leaving.setdefault(begin, []).append(number)
    row: list[int] = []
    for first in edges[:, 0].tolist():
        at = first
        while leaving.get(at):
            row.append(leaving[at].pop())
            at = int(edges[row[-1], 1])
    return np.array(row, dtype=np.int64)


def _normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Outward unit normals (t, 3)."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    return np.asarray(across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-30))
