"""Times at which a camera exposes, stores and stamps its images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import DepthImage, ImageSource, Nuisance

__all__ = ["LostFrames", "RollingShutter", "WarmUp"]

_BANDS = 4


@dataclass(frozen=True)
class RollingShutter(Nuisance):
    """Rows are exposed one after the other (data sheets of the D415 and D405: about 20 ms).

    Attributes:
        readout: time from the first row to the last [s].
    """

    readout: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 10 to 30 ms."""
        return cls(float(rng.uniform(0.01, 0.03)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Put an image together from bands of rows that were exposed at different times."""
        shares = (np.arange(_BANDS) + 0.5) / _BANDS - 0.5
        images = [source(instant + share * self.readout) for share in shares]
        bands = np.array_split(np.arange(len(images[0].depth)), _BANDS)

        def joined(name: str) -> Any:
            parts = [getattr(image, name)[rows] for image, rows in zip(images, bands, strict=True)]
            return np.concatenate(parts)

        names = ("depth", "what", "rays", "normals", "material")
        return DepthImage(**{name: joined(name) for name in names})


@dataclass(frozen=True)
class LostFrames(Nuisance):
    """Frames that are lost, and frames that are stored twice under two time stamps.

    Attributes:
        lost: share of lost frames [1].
        repeated: share of frames that are stored again in the place of the next [1].
    """

    lost: float
    repeated: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 2 to 10 % of lost and up to 5 % of repeated frames."""
        return cls(float(rng.uniform(0.02, 0.1)), float(rng.uniform(0.0, 0.05)))

    def stamped(self, instants: FloatArray, rng: np.random.Generator) -> tuple[Any, FloatArray]:
        """Lose some frames and repeat others."""
        source = np.arange(len(instants))
        again = np.flatnonzero(rng.random(len(instants) - 1) < self.repeated) + 1
        source[again] -= 1
        kept = rng.random(len(instants)) >= self.lost
        return source[kept], instants[kept]


@dataclass(frozen=True)
class WarmUp(Nuisance):
    """A camera that was just switched on: its depth moves by millimetres in its first minutes.

    The Azure Kinect needs 40 to 50 minutes (Tölgyessy et al. 2021).

    Attributes:
        size: change from the first to the last minute [m].
        time: after which 1/e of it is left [s].
    """

    causes = ("depth_bias", "camera_registration")
    size: float
    time: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a change of 1 to 2 mm over 3 to 10 minutes."""
        size = float(rng.uniform(1e-3, 2e-3) * rng.choice([-1, 1]))
        return cls(size, float(rng.uniform(180.0, 600.0)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Add what is still missing to the depth; `rest.ply` is taken cold."""
        image = source(instant)
        return replace(image, depth=image.depth + self.size * (1 - np.exp(-instant / self.time)))
