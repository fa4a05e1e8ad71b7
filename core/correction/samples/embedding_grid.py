"""The even grid on which a network works: through the bounds of a body, or over its top.

Points of the grid outside the body have the displacement of the nearest place of the body, as in
`palpate.mesh.protocol.Mesh.locate`. Over the top, a value holds for the whole column below it and
falls off linearly within one voxel: what lies deeper, as under an overhang, is not corrected.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.mesh.box_mesh import BoxMesh
from palpate.mesh.default_meshes import even_grid
from palpate.setup.phantom_geometry import Geometry

__all__ = ["EmbeddingGrid", "seen_from_above"]

_LEVEL = 1e-5
"""A point so little below the highest one of its column counts as seen from above [m]."""
_ON_FACE = 1e-9
"""A point so near to a face of the bounds lies in it [m]."""


def seen_from_above(geometry: Geometry, places: FloatArray) -> BoolArray:
    """Mark the places (m, 3) [m] of the surface that are the highest of their columns (m,)."""
    return np.asarray(places[:, 2] >= geometry.heights(places[:, :2]) - _LEVEL)


@dataclass(frozen=True, eq=False)
class EmbeddingGrid:
    """A regular grid of points, x fastest.

    Attributes:
        geometry: the body.
        nodes: number of points along x, y, z of the grid through the bounds.
        flat: whether it is the grid over the top, with the points along x and y only.
    """

    geometry: Geometry
    nodes: tuple[int, int, int]
    flat: bool = False

    def __post_init__(self) -> None:
        if len(self.nodes) != 3 or min(self.nodes) < 2:
            raise CorrectionError(
                f"a grid has two points or more along each of three axes, got {self.nodes}",
                key="nodes",
            )

    @cached_property
    def volume(self) -> BoxMesh:
        """The grid through the bounds."""
        return even_grid(self.geometry, self.nodes)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of points along x, y (and z)."""
        return self.nodes[:2] if self.flat else self.nodes

    @property
    def voxel(self) -> FloatArray:
        """Distance (3,) of neighbours along x, y, z [m]; of a flat grid as of the other."""
        return np.asarray(np.array(self.geometry.size) / (np.array(self.nodes) - 1))

    @cached_property
    def points(self) -> FloatArray:
        """Rest positions (n, 3) [m]; of a flat grid on the top of the body."""
        if not self.flat:
            return self.volume.nodes
        layer = self.volume.nodes[: self.nodes[0] * self.nodes[1], :2]
        return np.column_stack([layer, self.geometry.heights(layer)])

    def between(self, places: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the points (m, k) of the grid around places (m, 3) [m], and their shares (m, k) in
        a value there; outside the bounds as at the nearest place within.
        """
        if not self.flat:
            return self.volume.locate(places)
        lifted = np.column_stack([places[:, :2], np.full(len(places), self.geometry.height)])
        points, shares = self.volume.locate(lifted)
        layer = self.nodes[0] * self.nodes[1]
        depth = self.geometry.heights(places[:, :2]) - places[:, 2]
        share = np.clip(1.0 - depth / self.voxel[2], 0.0, 1.0)
        # The lower half of each cell has no share at the top.
        return points[:, 4:] - (self.nodes[2] - 1) * layer, shares[:, 4:] * share[:, None]

    def holds(self, places: FloatArray) -> bool:
        """Whether all places (m, 3) [m] lie in faces of the grid, as those of a block do."""
        low, high = self.geometry.low, self.geometry.high
        return bool((np.minimum(places - low, high - places) <= _ON_FACE).any(axis=1).all())
