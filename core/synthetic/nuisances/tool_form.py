"""Deviations of a tool from a ball on a thinner shaft.

They change what the camera sees; the ball that touches stays round.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import Nuisance

__all__ = ["Neck", "OtherShaft", "OutOfRound"]


@dataclass(frozen=True)
class OtherShaft(Nuisance):
    """A shaft that is thinner or thicker than the ball.

    Attributes:
        ratio: radius of the shaft over that of the ball [1].
    """

    ratio: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a ratio of 0.4 to 1.3."""
        return cls(float(rng.uniform(0.4, 1.3)))

    def tool(self, parts: list[tuple[FloatArray, Any]], radius: float) -> list[Any]:
        """Scale the shaft across its axis."""
        ball, (vertices, triangles) = parts
        across = np.linalg.norm(vertices[:, :2], axis=1).max()
        return [ball, (vertices * (*[self.ratio * radius / across] * 2, 1.0), triangles)]


@dataclass(frozen=True)
class Neck(Nuisance):
    """A thin neck between ball and shaft.

    Attributes:
        length: from the ball's surface to the shaft [m].
    """

    length: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 3 to 10 mm."""
        return cls(float(rng.uniform(3e-3, 10e-3)))

    def tool(self, parts: list[tuple[FloatArray, Any]], radius: float) -> list[Any]:
        """Let the shaft begin farther from the ball, and put a neck of half its radius between."""
        ball, (vertices, triangles) = parts
        begin, end = radius + self.length, vertices[:, 2].max()
        low = np.column_stack([vertices[:, :2] / 2, vertices[:, 2] / end * begin])
        high = np.column_stack([vertices[:, :2], begin + vertices[:, 2] / end * (end - begin)])
        return [ball, (high, triangles), (low, triangles)]


@dataclass(frozen=True)
class OutOfRound(Nuisance):
    """A ball that is longer in one direction.

    Attributes:
        by: half the difference of its largest and its smallest radius [m].
        seed: of the direction.
    """

    by: float
    seed: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw up to 0.1 mm."""
        return cls(float(rng.uniform(0.02e-3, 0.1e-3)), int(rng.integers(2**31)))

    def tool(self, parts: list[tuple[FloatArray, Any]], radius: float) -> list[Any]:
        """Stretch the ball along one axis and flatten it along another."""
        turn = Rotation.random(rng=np.random.default_rng(self.seed)).as_matrix()
        vertices, triangles = parts[0]
        scale = 1 + np.array([1.0, -1.0, 0.0]) * self.by / radius
        return [(vertices @ turn * scale @ turn.T, triangles), *parts[1:]]
