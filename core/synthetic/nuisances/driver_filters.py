"""Filters that cameras' drivers put on depth images.

They imitate those of librealsense ("Post-processing filters" of its documentation).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import DepthImage, ImageSource, Nuisance

__all__ = ["Decimation", "HoleFilling", "SpatialFilter", "TemporalFilter"]

_STEP = 5e-3
"""Step in depth that counts as an edge and is preserved [m]."""
_FRAME, _FRAMES = 1 / 30, 6
"""Time between frames of the stream that is filtered [s], and frames that are remembered."""


@dataclass(frozen=True)
class SpatialFilter(Nuisance):
    """Edge-preserving smoothing: rims of a phantom, which are smaller steps, are rounded.

    Attributes:
        width: standard deviation of the smoothing on the phantom [m].
    """

    width: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a width that rounds rims by 1 to 3 mm."""
        return cls(float(rng.uniform(0.7e-3, 2e-3)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Average neighbours that are no step away."""
        image = source(instant)
        width = self.width / (float(np.nanmedian(image.depth)) * image.pitch)
        reach = max(1, int(np.ceil(2 * width)))
        total, weight = np.zeros_like(image.depth), np.zeros_like(image.depth)
        for rows in range(-reach, reach + 1):
            for columns in range(-reach, reach + 1):
                other = np.roll(image.depth, (rows, columns), (0, 1))
                near = np.abs(other - image.depth) < _STEP
                share = np.exp(-0.5 * (rows**2 + columns**2) / width**2)
                total += np.where(near, share * other, 0.0)
                weight += np.where(near, share, 0.0)
        smooth = total / np.where(weight > 0, weight, np.nan)
        return replace(image, depth=np.where(np.isfinite(image.depth), smooth, np.nan))


@dataclass(frozen=True)
class HoleFilling(Nuisance):
    """Pixels without a reading take that of the nearest pixel to the left.

    Attributes:
        reach: farthest pixel that is taken.
    """

    reach: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a reach of 2 to 8 pixels."""
        return cls(int(rng.integers(2, 9)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Fill the holes."""
        image = source(instant)
        filled: FloatArray = image.depth.copy()
        for _ in range(self.reach):
            left = np.roll(filled, 1, axis=1)
            left[:, 0] = np.nan
            filled = np.where(np.isfinite(filled), filled, left)
        return replace(image, depth=filled)


@dataclass(frozen=True)
class Decimation(Nuisance):
    """Each 2 x 2 pixels become one, with the median of their readings."""

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """There is nothing to draw."""
        return cls()

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Halve the image."""
        image = source(instant)
        rows, columns = (2 * (length // 2) for length in image.depth.shape)
        tiles = image.depth[:rows, :columns].reshape(rows // 2, 2, columns // 2, 2)
        groups = tiles.transpose(0, 2, 1, 3).reshape(rows // 2, columns // 2, 4)
        known = np.isfinite(groups)
        ordered = np.sort(np.where(known, groups, np.inf), axis=2)
        middle = np.maximum(known.sum(axis=2) - 1, 0) // 2
        depth = np.take_along_axis(ordered, middle[..., None], axis=2)[..., 0]
        corners = slice(0, rows, 2), slice(0, columns, 2)
        last = slice(1, rows, 2), slice(1, columns, 2)
        return DepthImage(
            np.where(np.isfinite(depth), depth, np.nan),
            image.what[corners],
            (image.rays[corners] + image.rays[last]) / 2,
            image.normals[corners],
            image.material[corners],
        )


@dataclass(frozen=True)
class TemporalFilter(Nuisance):
    """An exponential average over the stream: less noise, but what moves lags and trails.

    A reading that differs by a step from the average replaces it. Where a pixel has no reading,
    the last one stays (persistence).

    Attributes:
        alpha: weight of the newest frame [1]; librealsense's default is 0.4.
        persistent: whether the last reading stays.
    """

    causes = ("time_offset",)
    alpha: float
    persistent: bool

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a weight of 0.2 to 0.5."""
        return cls(float(rng.uniform(0.2, 0.5)), bool(rng.random() < 0.5))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Average the last frames."""
        image = source(instant - (_FRAMES - 1) * _FRAME)
        average = image.depth
        for back in range(_FRAMES - 2, -1, -1):
            image = source(instant - back * _FRAME)
            near = np.abs(image.depth - average) < _STEP
            blended = self.alpha * image.depth + (1 - self.alpha) * average
            missing = average if self.persistent else np.full_like(average, np.nan)
            newest = np.where(near, blended, image.depth)
            average = np.where(np.isfinite(image.depth), newest, missing)
        return replace(image, depth=average)
