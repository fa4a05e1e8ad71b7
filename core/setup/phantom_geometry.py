"""Geometry of a phantom at rest: what all code outside `setup` and `mesh` may ask of any shape."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["CLEARANCE", "Geometry"]

CLEARANCE = 1.5e-3
"""A tool farther than this from the stated phantom [m] does not touch it, even if size or pose are
slightly wrong."""


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
    @abstractmethod
    def volume(self) -> float:
        """Enclosed volume [m^3]."""

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

    @abstractmethod
    def surface_points(self) -> FloatArray:
        """Rest positions (m, 3) [m] spread evenly over the free surface; the same at every call."""

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
