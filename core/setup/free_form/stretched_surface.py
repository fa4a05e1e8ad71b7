"""The free surface of a body whose size differs from the stated one along x, y or z."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray, lengths
from palpate.setup.phantom_geometry import Geometry, Surface

__all__ = ["StretchedSurface"]


@dataclass(frozen=True, eq=False)
class StretchedSurface(Surface):
    """The vertices and patches of a stated surface, at their places in a longer or shorter body.

    Distances to edges are those of the stated surface.

    Attributes:
        geometry: the body.
        stated: the surface of the stated body.
    """

    geometry: Geometry
    stated: Surface

    @property
    def patch(self) -> float:  # type: ignore[override]
        """Approximate edge length of a patch of the stated surface [m]."""
        return self.stated.patch

    @property
    def edge(self) -> float:  # type: ignore[override]
        """Distance to an edge below which points are left out [m]."""
        return self.stated.edge

    @cached_property
    def _factors(self) -> FloatArray:
        """True over stated lengths (3,) [1]."""
        return np.asarray(np.array(self.geometry.size) / np.array(self.stated.geometry.size))

    def own(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in this body of rest positions in the stated one."""
        return np.asarray(places * self._factors)

    def on_stated(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in the stated body, the inverse of `own`."""
        return np.asarray(places / self._factors)

    @cached_property
    def _mesh(self) -> tuple[FloatArray, IntArray, IntArray]:
        return self.own(self.stated.vertices), self.stated.faces, self.stated.side

    @property
    def patches(self) -> int:
        """Number of patches on all sides."""
        return self.stated.patches

    @property
    def patch_centres(self) -> FloatArray:
        """(p, 3) rest positions of the patches' centres [m]."""
        return self.own(self.stated.patch_centres)

    @property
    def patch_normals(self) -> FloatArray:
        """(p, 3) outward normals of the patches at rest."""
        return self._turned(self.stated.patch_normals)

    @property
    def patch_sides(self) -> IntArray:
        """(p,) numbers of the patches' sides."""
        return self.stated.patch_sides

    def patch_of(self, points: FloatArray, side: IntArray) -> IntArray:
        """Patch numbers (m,) of rest positions (m, 3) [m] on sides (m,)."""
        return self.stated.patch_of(self.on_stated(points), side)

    def edge_distance(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Distance (m,) [m] in the stated body of these places to the nearest edge of a side."""
        return self.stated.edge_distance(self.on_stated(points), side)

    def tangents(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Unit vectors (2, m, 3) along the surface, see `Surface.tangents`."""
        first, second = self.stated.tangents(self.on_stated(points), side)
        normal = self._turned(np.cross(first, second))
        first = first * self._factors
        first = first / lengths(first)[:, None]
        return np.stack([first, np.cross(normal, first)])

    def _turned(self, normals: FloatArray) -> FloatArray:
        """Normals (m, 3) of the stretched surface from those of the stated one."""
        across = normals / self._factors
        return np.asarray(across / lengths(across)[:, None])
