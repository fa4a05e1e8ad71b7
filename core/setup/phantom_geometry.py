"""Geometry and free surface of a phantom at rest: what code outside `setup` and `mesh` may ask of
any shape.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["CLEARANCE", "LEAST_EDGE", "PATCH", "SPACING", "Geometry", "Solid", "Surface"]

CLEARANCE = 1.5e-3
"""A tool farther than this from the stated phantom [m] does not touch it, even if size or pose are
slightly wrong."""
SPACING, PATCH = 1.5e-3, 4e-3
"""Largest distance of vertices, and approximate edge length of a patch [m]."""
LEAST_EDGE = 1.5e-3
"""Distance to an edge below which points are left out [m], whatever is declared: depth cameras
round edges."""


Solid = tuple[FloatArray, IntArray]
"""Vertices (v, 3) [m] and triangles (t, 3) of a rigid thing, phantom frame."""


class Geometry(ABC):
    """A body at rest in the phantom frame: z up, its base near z = 0."""

    @property
    @abstractmethod
    def low(self) -> FloatArray:
        """Lowest coordinates (3,) [m]."""

    @property
    @abstractmethod
    def high(self) -> FloatArray:
        """Highest coordinates (3,) [m]."""

    if TYPE_CHECKING:  # a property here could not be a field of a dataclass

        @property
        def size(self) -> tuple[float, float, float]:
            """Extent along x, y, z [m]."""

    @property
    def height(self) -> float:
        """Height of the highest point [m]."""
        return float(self.high[2])

    @property
    def is_block(self) -> bool:
        """Whether top and sides are the five free faces of a block along the axes."""
        return False

    @property
    def in_view(self) -> tuple[Solid, ...]:
        """Rigid things around the body, such as a tray, that a camera may see."""
        return ()

    @property
    @abstractmethod
    def volume(self) -> float:
        """Enclosed volume [m^3]."""

    @abstractmethod
    def scaled(self, factors: FloatArray) -> Self:
        """The body whose coordinates are multiplied by these factors (3,) [1]."""

    @abstractmethod
    def nearest(self, points: FloatArray) -> FloatArray:
        """Points of the body (m, 3) [m] nearest to points (m, 3) [m]; points inside stay where they
        are.
        """

    @abstractmethod
    def facing(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance to the surface, and the surface's normal next to each point.

        Args:
            points: (m, 3) [m].

        Returns:
            distances (m,) [m], negative inside, and unit normals (m, 3).
        """

    def facing_free(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance to the free surface, and its normal next to each point, as `facing`
        gives them for the surface with what is held.
        """
        return self.facing(points)

    @abstractmethod
    def outside(self, points: FloatArray) -> FloatArray:
        """Signed distance (m,) [m] of points (m, 3) [m] to the whole surface, base included,
        positive outside; of a free form interpolated, to about 0.2 mm.
        """

    @abstractmethod
    def below_skin(self, points: FloatArray) -> FloatArray:
        """Depth (m,) [m] of points (m, 3) [m] of the body below the surface on which a skin lies:
        the flat top of a block, the free surface of a free form.
        """

    @property
    @abstractmethod
    def closed_surface(self) -> tuple[FloatArray, IntArray]:
        """Vertices (v, 3) [m] and triangles (t, 3) of the whole surface, counter-clockwise from
        outside.
        """

    @abstractmethod
    def surface_points(self, counts: tuple[int, int, int] | None = None) -> FloatArray:
        """Rest positions (m, 3) [m] spread evenly over the free surface; the same at every call.

        Args:
            counts: number of points along x, y, z of a grid over the bounds, of which a block has
                those on its free faces; any other body has as many, and no fewer than without.
        """

    @abstractmethod
    def heights(self, places: FloatArray) -> FloatArray:
        """Height (m,) [m] of the highest point of the body above each of places x, y (m, 2) [m];
        beside the body that of the nearest place of it.
        """

    @abstractmethod
    def surface(
        self,
        spacing: float = SPACING,
        patch: float = PATCH,
        stated: Geometry | None = None,
        edge: float = LEAST_EDGE,
    ) -> Surface:
        """The free surface as material points, divided into patches.

        Args:
            spacing: largest distance of vertices [m].
            patch: approximate edge length of a patch [m].
            stated: geometry that sets the numbers of vertices and patches; this one if None.
            edge: distance to an edge of a side below which points are left out [m].
        """

    @abstractmethod
    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, SI units."""

    def distance(self, points: FloatArray) -> FloatArray:
        """Distance (m,) [m] of points (m, 3) [m] to the body; zero inside."""
        return np.asarray(np.linalg.norm(points - self.nearest(points), axis=1))

    def gap(self, centres: FloatArray, radius: float) -> FloatArray:
        """Gap (m,) [m] between balls around centres (m, 3) [m] and the surface; negative where a
        ball reaches into the body.
        """
        return self.facing(centres)[0] - radius


class Surface(ABC):
    """The free surface of a body at rest, of material points that move with it.

    A side is a part of the surface that no sharp edge divides. A stated geometry other than the
    body's own sets the numbers of vertices and patches, so that bodies of several sizes have the
    same.

    Attributes:
        geometry: the body.
        patch: approximate edge length of a patch [m].
        edge: distance to an edge of a side below which points are left out [m].
    """

    geometry: Geometry
    patch: float
    edge: float

    @property
    @abstractmethod
    def _mesh(self) -> tuple[FloatArray, IntArray, IntArray]:
        """Vertices, faces and side, see the properties of these names."""

    @property
    def vertices(self) -> FloatArray:
        """(v, 3) rest positions [m]; vertices on an edge stand once per side."""
        return self._mesh[0]

    @property
    def faces(self) -> IntArray:
        """(t, 3) triangles, counter-clockwise from outside."""
        return self._mesh[1]

    @property
    def side(self) -> IntArray:
        """(t,) number of each triangle's side."""
        return self._mesh[2]

    @property
    @abstractmethod
    def patches(self) -> int:
        """Number of patches on all sides."""

    @property
    @abstractmethod
    def patch_centres(self) -> FloatArray:
        """(p, 3) rest positions of the patches' centres [m]."""

    @property
    @abstractmethod
    def patch_normals(self) -> FloatArray:
        """(p, 3) outward normals of the patches at rest."""

    @property
    @abstractmethod
    def patch_sides(self) -> IntArray:
        """(p,) numbers of the patches' sides."""

    @abstractmethod
    def patch_of(self, points: FloatArray, side: IntArray) -> IntArray:
        """Patch numbers (m,) of rest positions (m, 3) [m] on sides (m,)."""

    @abstractmethod
    def edge_distance(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Distance (m,) [m] of rest positions to the nearest edge of their side, the base
        included.
        """

    @abstractmethod
    def tangents(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Unit vectors (2, m, 3) along the surface at rest positions (m, 3) [m] on sides (m,).

        They lead away from the nearest edges. The cross product of both is the outward normal.
        """

    def own(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in this body of rest positions in the stated one."""
        return places

    def on_stated(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in the stated body, the inverse of `own`."""
        return places
