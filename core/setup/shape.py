"""A body of any shape: a closed surface and what of it is held."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.setup.fixed_region import BoolArray, FixedRegion, Plane
from palpate.setup.surface_file import check_surface, read_surface

__all__ = ["Shape", "load_shape"]

_SAMPLES = 2000
_FLAT = 1e-4
"""How far a base may lie from z = 0 [m] to count as standing on the table."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A body within a closed surface, which is checked when it is made; equal to another with the
    same surface held the same way.

    Attributes:
        vertices: (v, 3) [m], phantom frame: z up, the base's height about zero.
        triangles: (t, 3), counter-clockwise from outside.
        fixed: what is held.
        name: for sentences, the file's.
    """

    vertices: FloatArray
    triangles: IntArray
    fixed: FixedRegion = field(default_factory=Plane)
    name: str = "surface"

    def __post_init__(self) -> None:
        check_surface(self.name, self.vertices, self.triangles)
        if self.held.all():
            raise MeshError(
                f"{self.name}: all {len(self.triangles)} triangles are held; leave some free",
                file=self.name,
            )

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shape) and self._digest == other._digest

    def __hash__(self) -> int:
        return hash(self._digest)

    @cached_property
    def _digest(self) -> bytes:
        parts = (
            np.ascontiguousarray(self.vertices, float),
            np.ascontiguousarray(self.triangles, np.int64),
            self.held,
        )
        return hashlib.sha256(b"".join(part.tobytes() for part in parts)).digest()

    @cached_property
    def held(self) -> BoolArray:
        """Which triangles are held (t,)."""
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
    def height(self) -> float:
        """Of the highest point [m]."""
        return float(self.high[2])

    @property
    def corners(self) -> FloatArray:
        """(t, 3, 3) of the triangles [m]."""
        return np.asarray(self.vertices[self.triangles])

    @cached_property
    def volume(self) -> float:
        """[m^3]."""
        a, b, c = self.corners.transpose(1, 0, 2)
        return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)

    @cached_property
    def flat_base(self) -> bool:
        """Whether all that is held lies in z = 0."""
        return bool(np.abs(self.corners[self.held][..., 2]).max() <= _FLAT)

    def nearest(self, points: FloatArray) -> FloatArray:
        """Places of the body (m, 3) [m] nearest to points (m, 3) [m]: the points themselves within
        it.
        """
        from palpate.setup.closest_point import nearest, winding_number

        _, places = nearest(np.ascontiguousarray(points, float), self.corners)
        inside = np.array(
            [winding_number(self.triangles, self.vertices, point) > 0.5 for point in points],
            dtype=bool,
        )
        return np.where(inside[:, None], points, places)

    def facing(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Distance (m,) [m] of points (m, 3) [m] to the surface, negative within, and the surface's
        normals (m, 3) next to them.
        """
        from palpate.setup.closest_point import nearest

        number, places = nearest(np.ascontiguousarray(points, float), self.corners)
        normals = self._normals[number]
        distance = np.linalg.norm(points - places, axis=1)
        return np.where(
            np.einsum("mi,mi->m", points - places, normals) < 0, -distance, distance
        ), normals

    @cached_property
    def _normals(self) -> FloatArray:
        """Outwards, of unit length (t, 3)."""
        a, b, c = self.corners.transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))

    def surface_points(self) -> FloatArray:
        """Rest positions (m, 3) [m] spread evenly over the free surface, without chance."""
        corners = self.corners[~self.held]
        areas = np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        ).cumsum()
        step = np.arange(_SAMPLES) + 0.5
        chosen = np.searchsorted(areas, step / _SAMPLES * areas[-1])
        # Two irrational steps fill the square evenly (Roberts 2018); what lies beyond its diagonal
        # is folded back.
        shares = np.stack([step * 0.7548776662466927, step * 0.5698402909980532], axis=1) % 1.0
        shares = np.where(shares.sum(axis=1, keepdims=True) > 1, 1 - shares, shares)
        weights = np.concatenate([1 - shares.sum(axis=1, keepdims=True), shares], axis=1)
        return np.asarray(np.einsum("mk,mki->mi", weights, corners[chosen]))

    def as_dict(self) -> dict[str, object]:
        """Plain values for JSON, SI units."""
        return {
            "surface": self.name,
            "size": list(self.size),
            "triangles": len(self.triangles),
            "held": int(self.held.sum()),
        }


def load_shape(path: Path, *, scale: float = 1.0, fixed: FixedRegion | None = None) -> Shape:
    """A body from a closed surface in a file (STL, PLY, OBJ), phantom frame.

    Args:
        scale: the file's unit of length [m]; it is never guessed.
        fixed: what is held, everything at z = 0 when left out.
    """
    vertices, triangles = read_surface(path, scale)
    return Shape(vertices, triangles, fixed or Plane(), path.name)
