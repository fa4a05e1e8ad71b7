"""A body of any shape: a closed surface and the part of it that is held."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.setup.free_form.column_heights import heights_above
from palpate.setup.free_form.distance_grid import DistanceGrid
from palpate.setup.free_form.fixed_region import Faces, FixedRegion, Plane
from palpate.setup.free_form.shape_surface import ShapeSurface
from palpate.setup.free_form.stretched_surface import StretchedSurface
from palpate.setup.free_form.surface_file import check_surface, read_surface
from palpate.setup.phantom_geometry import LEAST_EDGE, PATCH, SPACING, Geometry, Solid, Surface

__all__ = ["Shape", "load_shape"]

_SAMPLES = 2000
_FLAT = 1e-4
"""A base may lie so far from z = 0 [m] and still count as standing on the table."""


@dataclass(frozen=True, eq=False)
class Shape(Geometry):
    """A body within a closed surface, which is checked when the body is made.

    Two bodies are equal if they have the same surface, held in the same place.

    Attributes:
        vertices: (v, 3) [m], phantom frame: z up, the base near z = 0.
        triangles: (t, 3), counter-clockwise from outside.
        fixed: the part that is held.
        name: of the file, for messages.
        in_view: rigid things around the body, see `Geometry.in_view`.
    """

    vertices: FloatArray
    triangles: IntArray
    fixed: FixedRegion = field(default_factory=Plane)
    name: str = "surface"
    in_view: tuple[Solid, ...] = ()

    def __post_init__(self) -> None:
        check_surface(self.name, self.vertices, self.triangles)
        if self.held.all():
            raise MeshError(
                f"{self.name}: all {len(self.triangles)} triangles are held; leave some free",
                file=self.name,
            )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shape) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    @cached_property
    def digest(self) -> bytes:
        """SHA-256 of the surface and of what is held; equal bodies have the same."""
        parts = (
            np.ascontiguousarray(self.vertices, float),
            np.ascontiguousarray(self.triangles, np.int64),
            self.held,
        )
        return hashlib.sha256(b"".join(part.tobytes() for part in parts)).digest()

    @cached_property
    def held(self) -> BoolArray:
        """Mark the triangles that are held (t,)."""
        return self.fixed.mask(self.name, self.vertices, self.triangles)

    @cached_property
    def low(self) -> FloatArray:
        """Lowest coordinates (3,) [m]."""
        return np.asarray(self.vertices.min(axis=0))

    @cached_property
    def high(self) -> FloatArray:
        """Highest coordinates (3,) [m]."""
        return np.asarray(self.vertices.max(axis=0))

    @property
    def size(self) -> tuple[float, float, float]:
        """Extent along x, y, z [m]."""
        x, y, z = (float(length) for length in self.high - self.low)
        return x, y, z

    @property
    def corners(self) -> FloatArray:
        """Corners (t, 3, 3) of the triangles [m]."""
        return np.asarray(self.vertices[self.triangles])

    @cached_property
    def volume(self) -> float:
        """Enclosed volume [m^3]."""
        a, b, c = self.corners.transpose(1, 0, 2)
        return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)

    @cached_property
    def flat_base(self) -> bool:
        """Whether everything that is held lies in z = 0."""
        return bool(np.abs(self.corners[self.held][..., 2]).max() <= _FLAT)

    def scaled(self, factors: FloatArray) -> Shape:
        """The body whose coordinates are multiplied by these factors (3,) [1], held in the same
        triangles.
        """
        x, y, z = (float(factor) for factor in factors)
        return _scaled(self, (x, y, z))

    def nearest(self, points: FloatArray) -> FloatArray:
        """Points of the body (m, 3) [m] nearest to points (m, 3) [m]; points inside stay where they
        are.
        """
        from palpate.setup.free_form.closest_point import nearest, winding_number

        _, places = nearest(np.ascontiguousarray(points, float), self.corners)
        inside = np.array(
            [winding_number(self.triangles, self.vertices, point) > 0.5 for point in points],
            dtype=bool,
        )
        return np.where(inside[:, None], points, places)

    def facing(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance to the surface, and the surface's normal next to each point.

        Args:
            points: (m, 3) [m].

        Returns:
            distances (m,) [m], negative inside, and unit normals (m, 3).
        """
        return _facing(points, self.corners, self._normals)

    def facing_free(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance to the free surface and its normals, see `Geometry.facing_free`."""
        return _facing(points, self._free_corners, self._normals[~self.held])

    @cached_property
    def _free_corners(self) -> FloatArray:
        """Corners (f, 3, 3) of the triangles that are not held [m]."""
        return np.ascontiguousarray(self.corners[~self.held])

    @cached_property
    def _normals(self) -> FloatArray:
        """Outward unit normals (t, 3)."""
        a, b, c = self.corners.transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    def outside(self, points: FloatArray) -> FloatArray:
        """Signed distance (m,) [m], see `Geometry.outside`."""
        return self._distances(points)

    @cached_property
    def _distances(self) -> DistanceGrid:
        return DistanceGrid.of(self.vertices, self.triangles)

    def below_skin(self, points: FloatArray) -> FloatArray:
        """Depth (m,) [m] below the free surface, see `Geometry.below_skin`."""
        return -self._skin_distances(points)

    @cached_property
    def _skin_distances(self) -> DistanceGrid:
        return DistanceGrid.of(self.vertices, self.triangles, self.triangles[~self.held])

    @property
    def closed_surface(self) -> tuple[FloatArray, IntArray]:
        """Vertices [m] and triangles as stated, see `Geometry.closed_surface`."""
        return self.vertices, self.triangles

    def surface_points(self, counts: tuple[int, int, int] | None = None) -> FloatArray:
        """Rest positions (m, 3) [m] spread evenly over the free surface, see
        `Geometry.surface_points`.
        """
        count = _SAMPLES
        if counts is not None:
            nx, ny, nz = counts
            count = max(count, nx * ny + 2 * (nx + ny - 2) * (nz - 1))
        corners = self.corners[~self.held]
        areas = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).cumsum()
        step = np.arange(count) + 0.5
        chosen = np.searchsorted(areas, step / count * areas[-1])
        # Two irrational steps fill the square evenly (Roberts 2018). Points beyond its diagonal are
        # folded back.
        shares = np.stack([step * 0.7548776662466927, step * 0.5698402909980532], axis=1) % 1.0
        shares = np.where(shares.sum(axis=1, keepdims=True) > 1, 1 - shares, shares)
        weights = np.concatenate([1 - shares.sum(axis=1, keepdims=True), shares], axis=1)
        return np.asarray(np.einsum("mk,mki->mi", weights, corners[chosen]))

    def heights(self, places: FloatArray) -> FloatArray:
        """Height (m,) [m] of the surface above each place, see `Geometry.heights`."""
        return heights_above(self.vertices, self.triangles, places, self.surface_points())

    def surface(
        self,
        spacing: float = SPACING,
        patch: float = PATCH,
        stated: Geometry | None = None,
        edge: float = LEAST_EDGE,
    ) -> Surface:
        """The part of the surface that is not held, see `Geometry.surface`."""
        own = _surface(self if stated is None else stated, spacing, patch, edge)
        return own if stated is None else StretchedSurface(self, own)

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON, SI units."""
        return {
            "surface": self.name,
            "size": list(self.size),
            "triangles": len(self.triangles),
            "held": int(self.held.sum()),
        }


@lru_cache(maxsize=32)
def _scaled(shape: Shape, factors: tuple[float, float, float]) -> Shape:
    fixed = Faces.of(np.flatnonzero(shape.held))
    body = shape.vertices * factors
    return Shape(body, shape.triangles, fixed, shape.name, shape.in_view)


@lru_cache(maxsize=8)
def _surface(shape: Shape, spacing: float, patch: float, edge: float) -> ShapeSurface:
    return ShapeSurface(shape, shape.corners[~shape.held], spacing, patch, edge)


def load_shape(path: Path, *, scale: float = 1.0, fixed: FixedRegion | None = None) -> Shape:
    """Load a body from a closed surface in a file (STL, PLY, OBJ), phantom frame.

    Args:
        path: the file.
        scale: the file's unit of length [m]; it is never guessed.
        fixed: the part that is held; everything at z = 0 by default.
    """
    vertices, triangles = read_surface(path, scale)
    return Shape(vertices, triangles, fixed or Plane(), path.name)


def _facing(
    points: FloatArray, corners: FloatArray, normals: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Signed distance (m,) [m] to triangles (t, 3, 3), and the normal (m, 3) next to each point."""
    from palpate.setup.free_form.closest_point import nearest

    number, places = nearest(np.ascontiguousarray(points, float), corners)
    distance = np.linalg.norm(points - places, axis=1)
    inside = np.einsum("mi,mi->m", points - places, normals[number]) < 0
    return np.where(inside, -distance, distance), normals[number]
