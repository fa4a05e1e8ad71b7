"""The part of a surface that is held: below a plane, on a second surface, or named by triangles or
by vertices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.foundation.errors import MeshError

__all__ = ["Faces", "FixedRegion", "NearSurface", "Painted", "Plane"]


class FixedRegion(Protocol):
    """A rule for what is held."""

    def mask(self, name: str, vertices: FloatArray, triangles: IntArray) -> BoolArray:
        """Mark the triangles that are held.

        Raises MeshError, with the file's name, if none can be.

        Args:
            name: of the file, for messages.
            vertices: (v, 3) [m].
            triangles: (t, 3).

        Returns:
            (t,) True for held triangles.
        """


@dataclass(frozen=True)
class Plane:
    """All triangles below a plane: what stands on a table, or lies behind any other plane.

    Attributes:
        height: distance of the plane from the origin along the normal [m].
        tolerance: a triangle may reach so far above the plane [m].
        normal: unit normal of the plane; up unless stated.
    """

    height: float = 0.0
    tolerance: float = 1e-4
    normal: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def mask(self, name: str, vertices: FloatArray, triangles: IntArray) -> BoolArray:
        """Mark the triangles that are held (t,)."""
        tops = (vertices @ np.array(self.normal))[triangles].max(axis=1)
        held = tops <= self.height + self.tolerance
        if not held.any():
            x, y, z = self.normal
            plane = "z" if z == 1.0 else f"({x:.3g}, {y:.3g}, {z:.3g}) . (x, y, z)"
            raise MeshError(
                f"{name}: no triangle lies below {plane} = {self.height:g} m within "
                f"{self.tolerance:g} m, the lowest reaches up to {tops.min():.4g} m; expected what "
                "is held there: move the surface, or raise height or tolerance",
                file=name,
                height=self.height,
                tolerance=self.tolerance,
                lowest=float(tops.min()),
            )
        return np.asarray(held)


@dataclass(frozen=True, eq=False)
class NearSurface:
    """All triangles that lie on a second surface, such as a tray or a bone.

    Attributes:
        vertices: (v, 3) of the second surface [m].
        triangles: (t, 3) of it.
        tolerance: a corner may be so far from it [m].
        name: of its file, for messages.
    """

    vertices: FloatArray
    triangles: IntArray
    tolerance: float
    name: str

    def mask(self, name: str, vertices: FloatArray, triangles: IntArray) -> BoolArray:
        """Mark the triangles that are held (t,)."""
        from palpate.setup.free_form.closest_point import nearest

        _, places = nearest(np.ascontiguousarray(vertices, float), self.vertices[self.triangles])
        apart = np.linalg.norm(vertices - places, axis=1)
        farthest = apart[triangles].max(axis=1)
        held = farthest <= self.tolerance
        if not held.any():
            raise MeshError(
                f"{name}: no triangle lies within {self.tolerance:g} m of {self.name}, the nearest "
                f"is {farthest.min():.4g} m away; expected both in one frame and unit: move one of "
                "them, or raise fixed_tolerance",
                file=name,
                tolerance=self.tolerance,
                lowest=float(farthest.min()),
            )
        return np.asarray(held)


@dataclass(frozen=True)
class Faces:
    """Triangles by number, in the order of the file."""

    triangles: tuple[int, ...]

    @classmethod
    def of(cls, triangles: Sequence[int] | IntArray) -> Faces:
        """Make a region from any sequence of numbers."""
        return cls(tuple(int(number) for number in triangles))

    def mask(self, name: str, vertices: FloatArray, triangles: IntArray) -> BoolArray:
        """Mark the triangles that are held (t,)."""
        return _marked(name, "triangle", self.triangles, len(triangles))


@dataclass(frozen=True)
class Painted:
    """All triangles whose three vertices are painted; vertices by number, in the order of
    the file.
    """

    vertices: tuple[int, ...]

    @classmethod
    def of(cls, paint: Sequence[int] | IntArray | BoolArray) -> Painted:
        """Make a region from vertex numbers, or from one truth value per vertex (v,)."""
        numbers = np.asarray(paint)
        return cls(
            tuple(
                int(number)
                for number in (np.flatnonzero(numbers) if numbers.dtype == bool else numbers)
            )
        )

    def mask(self, name: str, vertices: FloatArray, triangles: IntArray) -> BoolArray:
        """Mark the triangles that are held (t,)."""
        held = np.asarray(
            _marked(name, "vertex", self.vertices, len(vertices))[triangles].all(axis=1)
        )
        if not held.any():
            raise MeshError(
                f"{name}: the {len(self.vertices)} painted vertices are nowhere all three corners "
                "of "
                "a triangle; expected an area: paint whole triangles",
                file=name,
                painted=len(self.vertices),
            )
        return held


def _marked(name: str, what: str, numbers: tuple[int, ...], count: int) -> BoolArray:
    if not numbers or min(numbers) < 0 or max(numbers) >= count:
        named = (
            f"{what} {max(numbers, key=lambda number: (number < 0, number))}"
            if numbers
            else f"no {what} at all"
        )
        raise MeshError(
            f"{name}: the fixed region names {named}; expected numbers from 0 to {count - 1}",
            file=name,
            count=count,
        )
    marked = np.zeros(count, dtype=bool)
    marked[list(numbers)] = True
    return marked
