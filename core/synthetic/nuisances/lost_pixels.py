"""Pixels without a reading."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from scipy import ndimage

from palpate.synthetic.nuisances.nuisance import DepthImage, ImageSource, Nuisance

__all__ = ["DarkHoles", "Gloss", "MaskedTool"]


@dataclass(frozen=True)
class Gloss(Nuisance):
    """A lamp that the wet surface mirrors into the camera blinds the pixels there.

    Its spot moves with the surface's slope, and with the lamp, which is nudged now and then.
    Smooth, glossy phantoms have such holes (librealsense 12500).

    Attributes:
        width: half angle of the spot [rad].
        lamp: place of the lamp (3,) [m], camera frame.
        sway: of the lamp from side to side in a sequence [m].
    """

    width: float
    lamp: tuple[float, float, float]
    sway: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a spot of 3 to 8 degrees, and a lamp above the phantom."""
        x, y, z = rng.uniform((-0.2, -0.6, 0.1), (0.2, -0.2, 0.4)).tolist()
        width = float(np.deg2rad(rng.uniform(3, 8)))
        return cls(width, (x, y, z), float(rng.uniform(0.0, 0.03)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Blind the pixels of the spot."""
        image = source(instant)
        places = image.rays * image.depth[..., None]
        lamp = self.lamp + self.sway * np.sin(0.5 * instant) * np.array([1.0, 0.0, 0.0])
        to_lamp, to_camera = lamp - places, -places
        to_lamp /= np.linalg.norm(to_lamp, axis=2, keepdims=True)
        to_camera /= np.linalg.norm(to_camera, axis=2, keepdims=True)
        half = to_lamp + to_camera
        half /= np.linalg.norm(half, axis=2, keepdims=True)
        aligned = np.abs(np.sum(half * image.normals, axis=2))
        spot = (image.what == 0) & (aligned > np.cos(self.width))
        return replace(image, depth=np.where(spot, np.nan, image.depth))


@dataclass(frozen=True)
class DarkHoles(Nuisance):
    """Patches of the block that give no reading, others in each image.

    Attributes:
        share: of the block's pixels without a reading [1].
        width: of the patches [pixels].
    """

    share: float
    width: float

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw 2 to 15 % in patches of 2 to 5 pixels."""
        return cls(float(rng.uniform(0.02, 0.15)), float(rng.uniform(1.0, 2.5)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Remove the patches."""
        image = source(instant)
        field = ndimage.gaussian_filter(rng.normal(size=image.depth.shape), self.width)
        lost = (image.what == 0) & (field > np.quantile(field, 1 - self.share))
        return replace(image, depth=np.where(lost, np.nan, image.depth))


@dataclass(frozen=True)
class MaskedTool(Nuisance):
    """The tool and a rim around it are cut out of the clouds, as recording software often does.

    Attributes:
        rim: width of the rim [pixels].
    """

    rim: int

    @classmethod
    def draw(cls, rng: np.random.Generator) -> Self:
        """Draw a rim of 1 to 3 pixels."""
        return cls(int(rng.integers(1, 4)))

    def image(self, source: ImageSource, instant: float, rng: np.random.Generator) -> DepthImage:
        """Remove the tool and the rim."""
        image = source(instant)
        masked = ndimage.binary_dilation(image.what > 1, iterations=self.rim)
        return replace(image, depth=np.where(masked, np.nan, image.depth))
