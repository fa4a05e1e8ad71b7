"""The free surface of a block: its top and four sides."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.setup.phantom_geometry import LEAST_EDGE, PATCH, SPACING, Geometry, Surface

__all__ = ["SIDES", "BlockSurface"]

SIDES = ("+z", "-y", "+y", "-x", "+x")
"""Sides of the free surface."""


@dataclass(frozen=True, eq=False)
class BlockSurface(Surface):
    """The top and the sides of a block, each with a regular grid of vertices and of patches.

    Attributes:
        geometry: the block.
        spacing: largest distance of vertices [m].
        patch: approximate edge length of a patch [m].
        stated: the block whose lengths set the numbers of vertices and patches; `geometry` if None.
        edge: distance to an edge of the block below which points are left out [m].
    """

    geometry: Geometry
    spacing: float = SPACING
    patch: float = PATCH
    stated: Geometry | None = None
    edge: float = LEAST_EDGE

    def _axes(self, side: str) -> tuple[int, int, int]:
        """Normal axis and the two axes in the plane, right-handed about the outward normal."""
        normal = "xyz".index(side[1])
        first, second = [(1, 2), (2, 0), (0, 1)][normal]
        return (normal, first, second) if side[0] == "+" else (normal, second, first)

    @cached_property
    def _lengths(self) -> FloatArray:
        """Edge lengths (3,) [m] of the stated block."""
        return np.array((self.stated or self.geometry).size)

    def own(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in this block of rest positions in the stated block."""
        return (
            places
            if self.stated is None
            else places * (np.array(self.geometry.size) / self._lengths)
        )

    def on_stated(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in the stated block, the inverse of `own`."""
        return (
            places
            if self.stated is None
            else places * (self._lengths / np.array(self.geometry.size))
        )

    @cached_property
    def _mesh(self) -> tuple[FloatArray, IntArray, IntArray]:
        low, high = self.geometry.low, self.geometry.high
        vertices, faces, sides, count = [], [], [], 0
        for number, side in enumerate(SIDES):
            normal, first, second = self._axes(side)
            steps = [
                max(2, int(np.ceil(self._lengths[a] / self.spacing)) + 1) for a in (first, second)
            ]
            lines = [
                np.linspace(low[a], high[a], n) for a, n in zip((first, second), steps, strict=True)
            ]
            grid = np.meshgrid(*lines, indexing="ij")
            points = np.empty((grid[0].size, 3))
            points[:, first], points[:, second] = grid[0].ravel(), grid[1].ravel()
            points[:, normal] = (high if side[0] == "+" else low)[normal]
            index = np.arange(len(points)).reshape(steps) + count
            a, b, c, d = (
                part.ravel()
                for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
            )
            quads = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
            vertices.append(points)
            faces.append(quads)
            sides.append(np.full(len(quads), number))
            count += len(points)
        return (
            np.concatenate(vertices),
            np.concatenate(faces).astype(np.int32),
            np.concatenate(sides),
        )

    @cached_property
    def _layout(self) -> tuple[list[tuple[int, int]], IntArray]:
        shapes = []
        for side in SIDES:
            _, first, second = self._axes(side)
            nx, ny = (max(1, round(self._lengths[a] / self.patch)) for a in (first, second))
            shapes.append((nx, ny))
        return shapes, np.concatenate([[0], np.cumsum([a * b for a, b in shapes])])

    @property
    def patches(self) -> int:
        """Number of patches on all sides."""
        return int(self._layout[1][-1])

    def patch_of(self, points: FloatArray, side: IntArray) -> IntArray:
        """Patch numbers (m,) of rest positions (m, 3) [m] on sides (m,)."""
        low, high = self.geometry.low, self.geometry.high
        shapes, offsets = self._layout
        result = np.empty(len(points), dtype=np.int64)
        for number, name in enumerate(SIDES):
            here = side == number
            _, *plane = self._axes(name)
            cell = [
                np.clip(((points[here, a] - low[a]) / (high[a] - low[a]) * n).astype(int), 0, n - 1)
                for a, n in zip(plane, shapes[number], strict=True)
            ]
            result[here] = offsets[number] + cell[0] * shapes[number][1] + cell[1]
        return result

    @cached_property
    def patch_centres(self) -> FloatArray:
        """(p, 3) rest positions of the patches' centres [m]."""
        low, high = self.geometry.low, self.geometry.high
        centres = []
        for name, (nx, ny) in zip(SIDES, self._layout[0], strict=True):
            normal, first, second = self._axes(name)
            points = np.empty((nx * ny, 3))
            for a, n, order in (
                (first, nx, np.arange(nx * ny) // ny),
                (second, ny, np.arange(nx * ny) % ny),
            ):
                points[:, a] = low[a] + (order + 0.5) / n * (high[a] - low[a])
            points[:, normal] = (high if name[0] == "+" else low)[normal]
            centres.append(points)
        return np.concatenate(centres)

    @cached_property
    def patch_normals(self) -> FloatArray:
        """(p, 3) outward normals of the patches at rest."""
        normals = []
        for name, (nx, ny) in zip(SIDES, self._layout[0], strict=True):
            normal = np.zeros(3)
            normal["xyz".index(name[1])] = 1.0 if name[0] == "+" else -1.0
            normals.append(np.tile(normal, (nx * ny, 1)))
        return np.concatenate(normals)

    @cached_property
    def patch_sides(self) -> IntArray:
        """(p,) numbers of the patches' sides."""
        return np.repeat(np.arange(len(SIDES)), np.diff(self._layout[1]))

    def edge_distance(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Distance (m,) [m] of rest positions to the nearest edge of their side, the base
        included.
        """
        low, high = self.geometry.low, self.geometry.high
        inside = np.minimum(points - low, high - points)
        normal_axis = np.array(["xyz".index(name[1]) for name in SIDES])[side]
        inside[np.arange(len(points)), normal_axis] = np.inf
        x, y, z = inside.T
        return np.asarray(np.minimum(np.minimum(x, y), z))

    def tangents(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Unit vectors (2, m, 3) along the side of each point, towards its middle."""
        middle = (self.geometry.low + self.geometry.high) / 2
        along = np.zeros((2, len(points), 3))
        for number, name in enumerate(SIDES):
            on = np.flatnonzero(side == number)
            first, second = self._axes(name)[1:]
            signs = np.where(points[on] > middle, -1.0, 1.0)
            rows = (signs[:, first] * signs[:, second] < 0).astype(
                int
            )  # so that the normal is outward
            along[rows, on, first] = signs[:, first]
            along[1 - rows, on, second] = signs[:, second]
        return along
