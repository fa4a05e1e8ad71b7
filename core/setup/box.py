"""A block, the phantom that needs no file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray, lengths
from palpate.setup.block_surface import BlockSurface
from palpate.setup.bounds import require_within
from palpate.setup.phantom_geometry import LEAST_EDGE, PATCH, SPACING, Geometry

__all__ = ["Box"]

_SAMPLING = (35, 21, 19)
"""Number of points along x, y, z at which the surface is sampled."""


@dataclass(frozen=True, kw_only=True)
class Box(Geometry):
    """A block on its base, edge lengths (x, y, z) [m]."""

    size: tuple[float, float, float]

    def __post_init__(self) -> None:
        for axis, length in zip("xyz", self.size, strict=True):
            require_within(f"size {axis}", length, 1e-3, 2.0, "m")

    @property
    def low(self) -> FloatArray:
        """Lowest corner (3,) [m], phantom frame."""
        return np.array([-self.size[0] / 2, -self.size[1] / 2, 0.0])

    @property
    def high(self) -> FloatArray:
        """Highest corner (3,) [m]."""
        return np.array([self.size[0] / 2, self.size[1] / 2, self.size[2]])

    @property
    def is_block(self) -> bool:
        """Whether top and sides are the faces of a block, see `Geometry.is_block`."""
        return True

    @property
    def volume(self) -> float:
        """Volume [m^3]."""
        return float(np.prod(self.size))

    def scaled(self, factors: FloatArray) -> Box:
        """The block whose edges are multiplied by these factors (3,) [1]."""
        x, y, z = (
            float(length * factor) for length, factor in zip(self.size, factors, strict=True)
        )
        return Box(size=(x, y, z))

    def nearest(self, points: FloatArray) -> FloatArray:
        """Points of the block (m, 3) [m] nearest to points (m, 3) [m]; points inside stay where
        they are.
        """
        return np.clip(points, self.low, self.high)

    def facing(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance to top and sides, and the normal of the side that faces each point.

        The base is not one of these sides.

        Args:
            points: (m, 3) [m].

        Returns:
            distances (m,) [m], negative inside, and unit normals (m, 3).
        """
        beyond = np.concatenate(
            [np.abs(points[:, :2]) - self.high[:2], points[:, 2:] - self.size[2]], axis=1
        )
        distance = np.linalg.norm(np.maximum(beyond, 0), axis=1) + np.minimum(beyond.max(axis=1), 0)
        side = beyond.argmax(axis=1)
        normals = (
            np.eye(3)[side]
            * np.where(side == 2, 1.0, np.sign(points[np.arange(len(points)), side]))[:, None]
        )
        return np.asarray(distance), np.asarray(normals)

    def outside(self, points: FloatArray) -> FloatArray:
        """Signed distance (m,) [m], see `Geometry.outside`."""
        half = np.array(self.size) / 2
        beyond = np.abs(points - np.array([0.0, 0.0, half[2]])) - half
        x, y, z = beyond.T
        return np.asarray(
            lengths(np.maximum(beyond, 0.0)) + np.minimum(np.maximum(np.maximum(x, y), z), 0.0)
        )

    def below_skin(self, points: FloatArray) -> FloatArray:
        """Depth (m,) [m] below the top, see `Geometry.below_skin`."""
        return np.asarray(self.size[2] - points[:, 2])

    @property
    def closed_surface(self) -> tuple[FloatArray, IntArray]:
        """The eight corners [m] and twelve triangles, see `Geometry.closed_surface`."""
        corners = [[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]
        quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        halves = [half for a, b, c, d in quads for half in ((a, b, c), (a, c, d))]
        return np.where(np.array(corners) == 1, self.high, self.low), np.array(halves)

    def surface_points(self, counts: tuple[int, int, int] | None = None) -> FloatArray:
        """Points (m, 3) [m] of a grid on the free surface, see `Geometry.surface_points`."""
        axes = [
            np.linspace(low, high, count)
            for low, high, count in zip(self.low, self.high, counts or _SAMPLING, strict=True)
        ]
        z, y, x = (axis.ravel() for axis in np.meshgrid(*axes[::-1], indexing="ij"))
        points = np.stack([x, y, z], axis=1)
        on_side = (np.abs(points[:, :2]) == self.high[:2]).any(axis=1)
        return np.asarray(points[on_side | (points[:, 2] == self.high[2])])

    def heights(self, places: FloatArray) -> FloatArray:
        """The height of the block (m,) [m], see `Geometry.heights`."""
        return np.full(len(places), self.size[2])

    def surface(
        self,
        spacing: float = SPACING,
        patch: float = PATCH,
        stated: Geometry | None = None,
        edge: float = LEAST_EDGE,
    ) -> BlockSurface:
        """Top and sides, see `Geometry.surface`."""
        return BlockSurface(self, spacing, patch, stated, edge)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"size": list(self.size)}
