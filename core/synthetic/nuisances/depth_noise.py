"""Noise and systematic errors of a depth reading."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import DepthImage, ImageSource, Nuisance
from palpate.synthetic.nuisances.random_waves import WAVES, sum_of_waves

__all__ = ["FlyingPixels", "MultiPath", "SmoothBias", "StereoNoise"]

REFERENCE = 0.35
"""Distance at which sizes are stated [m]."""
_EDGE = 4e-3
"""Step in depth between neighbouring pixels that makes an edge [m]."""


@dataclass(frozen=True)
class StereoNoise(Nuisance):
    """White noise that grows with the distance squared and with the slant, and steps of disparity.

    Stereo: RMS error = distance^2 x subpixel / (focal length x baseline) (Grunnet-Jepsen et al.,
    "Tuning depth cameras for best performance"). Structured light and time of flight grow alike
    within a phantom's depth. With the slant it grows as 1 + theta^2 / (pi/2 - theta)^2 (Nguyen,
    Izadi and Lovell 2012). Disparities come in steps (Khoshelham and Oude Elberink 2012).

    Attributes:
        sigma: standard deviation at REFERENCE, seen at right angles [m].
        step: of the depth at REFERENCE [m].
        slant: weight of the growth with the slant [1].
    """

    sigma: float
    step: float
    slant: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 0.3 to 1 mm of noise, evenly in the logarithm."""
        return cls.between(rng, 0.3e-3, 1e-3)

    @classmethod
    def between(cls, rng: np.random.Generator, low: float, high: float) -> Self:
        """Draw the noise between two standard deviations [m], evenly in the logarithm."""
        sigma = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        return cls(sigma, float(rng.uniform(0.1, 0.6)) * sigma, float(rng.uniform(0.0, 0.1)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Add the noise and round."""
        image = source(instant)
        square = (image.depth / REFERENCE) ** 2
        angle = np.minimum(image.slant, np.deg2rad(80))
        grown = 1 + self.slant * angle**2 / (np.pi / 2 - angle) ** 2
        noisy = image.depth + rng.normal(size=image.depth.shape) * self.sigma * grown * square
        return replace(image, depth=self._rounded(noisy))

    def _rounded(self, depth: FloatArray) -> FloatArray:
        """Depth in steps of the disparity 1 / depth."""
        if not self.step:
            return depth
        step = self.step / REFERENCE**2
        return np.asarray(1 / (np.round(1 / depth / step) * step))


@dataclass(frozen=True)
class SmoothBias(Nuisance):
    """An error that is fixed in the image, smooth, and grows with the distance.

    Up to a millimetre and more at short range for stereo and time of flight (Carfagni et al. 2019;
    Tölgyessy et al. 2021).

    Attributes:
        amplitude: RMS at REFERENCE [m].
        seed: of its shape.
    """

    amplitude: float
    seed: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw an RMS of 0.1 to 0.4 mm, which is 0.3 to 1 mm at its largest."""
        return cls(float(rng.uniform(0.1e-3, 0.4e-3)), int(rng.integers(2**31)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Add the error."""
        image = source(instant)
        places = image.rays[..., :2]
        width = float(np.max(np.ptp(places.reshape(-1, 2), axis=0)))
        draw = np.random.default_rng(self.seed)
        waves = draw.normal(size=(WAVES, 2)) * 2 * np.pi * 1.3 / width
        field = sum_of_waves(places, waves, draw) / np.sqrt(WAVES / 2)
        return replace(image, depth=image.depth + self.amplitude * field * image.depth / REFERENCE)


@dataclass(frozen=True)
class MultiPath(Nuisance):
    """Light that comes by way of the table makes the foot of the block look farther away.

    Concave corners of time-of-flight cameras are off by millimetres (Tölgyessy et al. 2021).

    Attributes:
        size: error at the corner [m].
        reach: distance from the corner at which it has fallen to 1/e [m].
    """

    size: float
    reach: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw an error of 0.5 to 2 mm that reaches 2 to 4 mm."""
        return cls(float(rng.uniform(0.5e-3, 2e-3)), float(rng.uniform(2e-3, 4e-3)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Add the error to the foot of the block."""
        image = source(instant)
        height = np.where(image.what == 0, image.material[..., 2], np.inf)
        return replace(image, depth=image.depth + self.size * np.exp(-height / self.reach))


@dataclass(frozen=True)
class FlyingPixels(Nuisance):
    """Pixels at an edge that lie between the surfaces before and behind it.

    Few in stereo with a filter, up to a third of an edge's pixels in time of flight (Tölgyessy et
    al. 2021).

    Attributes:
        share: of the pixels at edges [1].
    """

    share: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 1 to 30 %."""
        return cls(float(rng.uniform(0.01, 0.3)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Mix the depths on both sides of edges."""
        image = source(instant)
        mixed = image.depth.copy()
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            other = np.roll(image.depth, step, axis)
            flying = np.abs(other - image.depth) > _EDGE
            flying &= rng.random(flying.shape) < self.share / 2
            between = image.depth + (other - image.depth) * rng.random(flying.shape)
            mixed[flying] = between[flying]
        return replace(image, depth=mixed)
