"""Deviations of a cast phantom from the stated block.

They change the surface that the camera sees, not the mesh that is solved: they are small against
the elements, and most lie away from the tool.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import DepthImage, ImageSource, Nuisance
from palpate.synthetic.nuisances.random_waves import WAVES, sum_of_waves

__all__ = ["Draft", "RoundedEdges", "SaggingTop", "Texture"]


@dataclass(frozen=True)
class RoundedEdges(Nuisance):
    """Edges rounded as a mould's fillets and a gel's meniscus make them.

    Attributes:
        radius: of the rounding [m].
    """

    radius: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a radius of 1 to 3 mm."""
        return cls(float(rng.uniform(1e-3, 3e-3)))

    def form(self, surface: FloatArray, size: tuple[float, float, float]) -> FloatArray:
        """Move points near an edge onto a rolling ball's surface; the foot stays sharp."""
        half = np.array([size[0] / 2, size[1] / 2, size[2]])
        low, high = -half + self.radius, half - self.radius
        low[2] = -np.inf
        core = np.clip(surface, low, high)
        away = surface - core
        length = np.linalg.norm(away, axis=1, keepdims=True)
        rounded = core + away * self.radius / np.maximum(length, 1e-12)
        return np.asarray(np.where(length > self.radius, rounded, surface))


@dataclass(frozen=True)
class Draft(Nuisance):
    """Sides that lean, so that the cast leaves its mould; the stated size is that at half height.

    Attributes:
        angle: of the sides from the vertical [rad].
    """

    angle: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 0.3 to 1 degree."""
        return cls(float(np.deg2rad(rng.uniform(0.3, 1.0))))

    def form(self, surface: FloatArray, size: tuple[float, float, float]) -> FloatArray:
        """Narrow the block towards its top."""
        inwards = np.tan(self.angle) * (surface[:, 2:] - size[2] / 2)
        flat = surface[:, :2] * (1 - inwards / (np.array(size[:2]) / 2))
        return np.column_stack([flat, surface[:, 2]])


@dataclass(frozen=True)
class SaggingTop(Nuisance):
    """A top that sags as a gel dries, or domes as it was poured.

    Attributes:
        height: of the middle above the rim [m].
    """

    height: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw up to 0.3 mm either way."""
        return cls(float(rng.uniform(-0.3e-3, 0.3e-3)))

    def form(self, surface: FloatArray, size: tuple[float, float, float]) -> FloatArray:
        """Lift or lower the top; the rim keeps its height."""
        x, y = (np.clip(2 * surface[:, axis] / size[axis], -1, 1) for axis in range(2))
        lift = self.height * (1 - x**2) * (1 - y**2) * surface[:, 2] / size[2]
        return np.asarray(surface + lift[:, None] * np.array([0.0, 0.0, 1.0]))


@dataclass(frozen=True)
class Texture(Nuisance):
    """A rough surface, which moves with the material.

    Attributes:
        size: RMS height [m].
        length: of its waves [m].
        seed: of its shape.
    """

    size: float
    length: float
    seed: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw heights of up to 0.2 mm (an RMS of up to 0.1 mm) over 3 to 8 mm."""
        return cls(
            float(rng.uniform(0.02e-3, 0.1e-3)),
            float(rng.uniform(3e-3, 8e-3)),
            int(rng.integers(2**31)),
        )

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Add the heights along the line of sight."""
        image = source(instant)
        draw = np.random.default_rng(self.seed)
        waves = draw.normal(size=(WAVES, 3))
        waves *= 2 * np.pi / self.length / np.linalg.norm(waves, axis=1, keepdims=True)
        places = np.where(np.isfinite(image.material), image.material, 0.0)
        heights = sum_of_waves(places, waves, draw) / np.sqrt(WAVES / 2)
        return replace(
            image, depth=image.depth - np.where(image.what == 0, self.size * heights, 0.0)
        )
