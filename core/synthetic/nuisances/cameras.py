"""Depth cameras by name: noise, steps and flying pixels at a phantom's distance."""

from __future__ import annotations

from collections.abc import Mapping

from palpate.synthetic.nuisances.depth_noise import REFERENCE, FlyingPixels, MultiPath, StereoNoise
from palpate.synthetic.nuisances.nuisance import Nuisance

__all__ = ["CAMERAS"]

_SUBPIXEL, _STEPS = 0.08, 32
"""RMS error of a disparity on a surface with texture, and steps of a disparity per pixel [1]."""


def _stereo(focal: float, baseline: float) -> StereoNoise:
    """Noise of a stereo camera with this focal length [pixels] and baseline [m]."""
    per_pixel = REFERENCE**2 / (focal * baseline)
    return StereoNoise(_SUBPIXEL * per_pixel, per_pixel / _STEPS, 0.05)


CAMERAS: Mapping[str, tuple[Nuisance, ...]] = {
    "d405": (FlyingPixels(0.05), _stereo(674.0, 0.018)),
    "d415": (FlyingPixels(0.05), _stereo(1005.0, 0.055)),
    "d435": (FlyingPixels(0.05), _stereo(447.0, 0.050)),
    "azure-kinect": (MultiPath(1.5e-3, 3e-3), FlyingPixels(0.3), StereoNoise(1.0e-3, 1.0e-3, 0.05)),
    "structured-light": (FlyingPixels(0.02), StereoNoise(0.1e-3, 0.0, 0.05)),
}
"""The nuisances of each camera. RealSense: focal length and baseline by data sheet at the best
resolution (D405 and D415 1280, D435 848 pixels wide), errors by Grunnet-Jepsen et al., "Tuning
depth cameras for best performance". Azure Kinect: Tölgyessy et al. 2021, depth in millimetres."""
