"""The free surface of a body whose cast differs from its drawing."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.setup.free_form.cast_modes import CastModes, Coefficients
from palpate.setup.phantom_geometry import Geometry, Surface

__all__ = ["CastSurface"]


@dataclass(frozen=True, eq=False)
class CastSurface(Surface):
    """The vertices and patches of a surface without offset, moved by the cast's offset.

    Normals, sides and distances to edges are those of that surface: an offset of tenths of a
    millimetre turns a surface by a degree or two.

    Attributes:
        under: the surface without offset, of the same size.
        modes: of the stated body.
        coefficients: of the offset [m].
    """

    under: Surface
    modes: CastModes
    coefficients: Coefficients

    @property
    def geometry(self) -> Geometry:  # type: ignore[override]
        """The body without offset."""
        return self.under.geometry

    @property
    def patch(self) -> float:  # type: ignore[override]
        """Approximate edge length of a patch [m]."""
        return self.under.patch

    @property
    def edge(self) -> float:  # type: ignore[override]
        """Distance to an edge below which points are left out [m]."""
        return self.under.edge

    def own(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in this body of rest positions in the stated one."""
        return self.under.own(places + self.modes.motion(self.coefficients, places))

    def on_stated(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in the stated body, the inverse of `own` to some micrometres.

        The offset changes slowly, so that two steps of the fixed point do.
        """
        there = self.under.on_stated(places)
        found = there
        for _ in range(2):
            found = there - self.modes.motion(self.coefficients, found)
        return np.asarray(found)

    def _plain(self, places: FloatArray) -> FloatArray:
        """Places (m, 3) [m] of the surface without offset."""
        return self.under.own(self.on_stated(places))

    @cached_property
    def _mesh(self) -> tuple[FloatArray, IntArray, IntArray]:
        plain = self.under.on_stated(self.under.vertices)
        return self.own(plain), self.under.faces, self.under.side

    @property
    def patches(self) -> int:
        """Number of patches on all sides."""
        return self.under.patches

    @cached_property
    def patch_centres(self) -> FloatArray:
        """(p, 3) rest positions of the patches' centres [m]."""
        return self.own(self.under.on_stated(self.under.patch_centres))

    @property
    def patch_normals(self) -> FloatArray:
        """(p, 3) outward normals of the patches at rest."""
        return self.under.patch_normals

    @property
    def patch_sides(self) -> IntArray:
        """(p,) numbers of the patches' sides."""
        return self.under.patch_sides

    def patch_of(self, points: FloatArray, side: IntArray) -> IntArray:
        """Patch numbers (m,) of rest positions (m, 3) [m] on sides (m,)."""
        return self.under.patch_of(self._plain(points), side)

    def edge_distance(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Distance (m,) [m] without offset of these places to the nearest edge of a side."""
        return self.under.edge_distance(self._plain(points), side)

    def tangents(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Unit vectors (2, m, 3) along the surface without offset, see `Surface.tangents`."""
        return self.under.tangents(self._plain(points), side)
