"""Camera to phantom from the rest cloud, for a phantom of any shape.

The faces of a block determine its pose more finely than a search over a free form does, which
serves every other shape.
"""

from __future__ import annotations

from dataclasses import replace

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.block_fit import fit_camera, nearest_pose, refine_camera
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.camera.heading import turned_fit
from palpate.registration.shape.shape_fit import (
    fit_shape_camera,
    nearest_shape_pose,
    refine_shape_camera,
)
from palpate.setup.phantom_geometry import Geometry

__all__ = ["fit_rest_cloud", "nearest_rest_pose", "refine_rest_cloud"]


def fit_rest_cloud(
    cloud: FloatArray, geometry: Geometry, depth_sigma: float, guess: Transform | None = None
) -> CameraFit:
    """Register a raw rest cloud to a phantom; its `alternatives` fit about as well.

    Args:
        cloud: (n, 3) [m], camera frame.
        geometry: of the phantom.
        depth_sigma: stated accuracy of depth [m].
        guess: phantom_from_camera; None without.

    Raises RegistrationError where that is impossible.
    """
    if not geometry.is_block:
        return fit_shape_camera(cloud, geometry, depth_sigma, guess)
    fit = fit_camera(cloud, geometry.size, depth_sigma, guess)
    return replace(fit, alternatives=(turned_fit(fit),))


def refine_rest_cloud(
    cloud: FloatArray, geometry: Geometry, start: Transform, depth_sigma: float
) -> CameraFit:
    """Register a raw rest cloud from `start` (phantom_from_camera) alone, without a search.

    Args and errors are those of `fit_rest_cloud`.
    """
    if geometry.is_block:
        return refine_camera(cloud, geometry.size, start, depth_sigma)
    return refine_shape_camera(cloud, geometry, start, depth_sigma)


def nearest_rest_pose(
    cloud: FloatArray, geometry: Geometry, start: Transform, depth_sigma: float
) -> Transform:
    """Find the pose next to `start` (phantom_from_camera) in which a raw cloud of the untouched
    phantom shows it, without its uncertainty.

    Args and errors are those of `fit_rest_cloud`.
    """
    if geometry.is_block:
        return nearest_pose(cloud, geometry.size, start, depth_sigma)
    return nearest_shape_pose(cloud, geometry, start, depth_sigma)
