"""The base class of the nuisances: what real cameras, robots, tools and phantoms add to data."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["DepthImage", "ImageSource", "Nuisance", "StatedMotion"]

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class DepthImage:
    """One depth image.

    Attributes:
        depth: (rows, columns) depth along the optical axis [m]; NaN without a reading.
        what: (rows, columns) object: 0 block, 1 table, above 1 tool, -1 none.
        rays: (rows, columns, 3) directions of the pixels with z = 1, camera frame.
        normals: (rows, columns, 3) unit normals of the surfaces seen, camera frame.
        material: (rows, columns, 3) places on the block at rest, phantom frame [m]; NaN elsewhere.
    """

    depth: FloatArray
    what: Any
    rays: FloatArray
    normals: FloatArray
    material: FloatArray

    @property
    def slant(self) -> FloatArray:
        """Angle (rows, columns) [rad] between the line of sight and the surface's normal."""
        sight = self.rays / np.linalg.norm(self.rays, axis=2, keepdims=True)
        cosine = np.abs(np.sum(sight * self.normals, axis=2))
        return np.asarray(np.arccos(np.clip(cosine, 0.0, 1.0)))

    @property
    def pitch(self) -> float:
        """Distance between neighbouring rays at z = 1 [1]."""
        return float(abs(self.rays[0, 1, 0] - self.rays[0, 0, 0]))


ImageSource = Callable[[float], DepthImage]
"""Takes the image of an instant [s] of the sequence."""


@dataclass(frozen=True, eq=False)
class StatedMotion:
    """Motion of the tool as the robot knows it, phantom frame.

    Attributes:
        times: (n,) [s].
        centres: (n, 3) of the tool [m].
        velocities: (n, 3) [m/s].
        forces: (n, 3) of the block on the tool [N].
    """

    times: FloatArray
    centres: FloatArray
    velocities: FloatArray
    forces: FloatArray


@dataclass(frozen=True)
class Nuisance(ABC):
    """One nuisance. Every method leaves things as they are unless a subclass changes them.

    The parameters of a subclass are its fields, in SI units. Its docstring names the source of its
    sizes.

    Attributes:
        causes: names of effects that state this nuisance. With any, it is hidden alone, and these
            names are right; without, nothing is to be named for it.
    """

    causes: ClassVar[tuple[str, ...]] = ()

    @classmethod
    @abstractmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw the parameters."""

    @property
    def robot_rate(self) -> float | None:
        """Poses of the tool per second [1/s]; None leaves the scenario's."""
        return None

    def form(self, surface: FloatArray, size: tuple[float, float, float]) -> FloatArray:
        """Change points (s, 3) [m] of a block's surface at rest."""
        return surface

    def tool(self, parts: list[tuple[FloatArray, Any]], radius: float) -> list[Any]:
        """Change the meshes of the ball and of the shaft, which leaves it along z from the origin.

        Args:
            parts: vertices (v, 3) [m] and triangles (t, 3) of each.
            radius: of the ball [m].
        """
        return parts

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Take the image of an instant [s] from images of `source`."""
        return source(instant)

    def stamped(self, instants: FloatArray, rng: np.random.Generator) -> tuple[Any, FloatArray]:
        """Choose the clouds that are stored.

        Args:
            instants: (n,) of exposure [s].
            rng: random generator.

        Returns:
            indices (m,) of the clouds, and their time stamps (m,) [s].
        """
        return np.arange(len(instants)), instants

    def stated(self, motion: StatedMotion) -> FloatArray:
        """Tool centres (n, 3) [m] that the robot states."""
        return motion.centres

    @property
    def parameters(self) -> dict[str, Any]:
        """The parameters by name."""
        return {one.name: getattr(self, one.name) for one in fields(self)}
