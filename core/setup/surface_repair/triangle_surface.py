"""A surface of triangles that need not be closed, and the interface of a step that repairs it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["RepairStep", "TriangleSurface"]


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """Triangles between vertices, whatever they enclose.

    Attributes:
        vertices: (v, 3) [m].
        triangles: (t, 3).
        name: of the file, for messages.
    """

    vertices: FloatArray
    triangles: IntArray
    name: str = "surface"

    @property
    def corners(self) -> FloatArray:
        """Corners (t, 3, 3) of the triangles [m]."""
        return np.asarray(self.vertices[self.triangles])

    @property
    def areas(self) -> FloatArray:
        """Areas (t,) of the triangles [m^2]."""
        a, b, c = self.corners.transpose(1, 0, 2)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    @property
    def volume(self) -> float:
        """Enclosed volume [m^3]: negative inside out, without meaning for an open surface."""
        a, b, c = (self.corners - self.vertices.mean(axis=0)).transpose(1, 0, 2)
        return float(np.einsum("ti,ti->", a, np.cross(b, c)) / 6)

    def of(self, triangles: IntArray, vertices: FloatArray | None = None) -> TriangleSurface:
        """The same body with other triangles, without vertices that none of them uses."""
        places = self.vertices if vertices is None else vertices
        used, numbers = np.unique(triangles, return_inverse=True)
        kept = numbers.reshape(-1, 3).astype(np.int64)
        return TriangleSurface(np.asarray(places[used], float), kept, self.name)


class RepairStep(Protocol):
    """One change of a surface, with a sentence on what it did."""

    @property
    def title(self) -> str:
        """Name of the step, for readers."""

    @property
    def unmoved(self) -> str:
        """Reason why the step changes no form, for readers; empty where the deviation is to be
        measured.
        """

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Change a surface; MeshError where that is impossible.

        Returns:
            the new surface, and what was done, with numbers.
        """
