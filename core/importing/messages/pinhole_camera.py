"""Points from depth images by a camera's intrinsics, with its lens distortion removed."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = ["PinholeCamera"]

_STEPS = 20
"""Steps of the fixed-point iteration; each gains a digit or more below 0.3 of distortion."""


@dataclass(frozen=True, eq=False)
class PinholeCamera:
    """Intrinsics of a depth camera.

    Attributes:
        size: (rows, columns) of its images.
        focal: (2,) focal lengths [pixels].
        centre: (2,) principal point [pixels].
        distortion: k1, k2, p1, p2, k3 [1], and k4, k5, k6 of the rational model; source: Brown
            1966, as in sensor_msgs/CameraInfo. Images of a RealSense are without: zeros.
    """

    size: tuple[int, int]
    focal: FloatArray
    centre: FloatArray
    distortion: FloatArray = field(default_factory=lambda: np.zeros(5))

    @classmethod
    def from_numbers(
        cls, size: tuple[int, int], matrix: FloatArray, distortion: FloatArray
    ) -> PinholeCamera:
        """Make a camera from its matrix, row major (9,) or (3, 3), and its distortion (0 to 8,).

        Raises DatasetError for focal lengths that are not positive.
        """
        fx, _, cx, _, fy, cy = np.asarray(matrix, dtype=float).ravel()[:6]
        if not (fx > 0 and fy > 0):
            raise DatasetError(
                f"the camera's focal lengths are {fx:g} and {fy:g} pixels; expected positive ones: "
                "its camera_info was not calibrated",
                value=f"{fx:g}",
            )
        full = np.zeros(8)
        full[: len(distortion)] = distortion
        return cls(size, np.array([fx, fy]), np.array([cx, cy]), full)

    def points(self, depth: FloatArray) -> FloatArray:
        """Points (rows, columns, 3) [m], camera frame, of depths (rows, columns) [m] along z."""
        if depth.shape != self.size:
            raise DatasetError(
                f"a depth image has {depth.shape[0]} x {depth.shape[1]} pixels, its camera_info "
                f"{self.size[0]} x {self.size[1]}; expected the same: name the camera_info of this "
                "image",
                value=f"{depth.shape[0]} x {depth.shape[1]}",
            )
        return np.concatenate([self._slopes * depth[..., None], depth[..., None]], axis=-1)

    @cached_property
    def _slopes(self) -> FloatArray:
        """x / z and y / z (rows, columns, 2) of each pixel's ray."""
        rows, columns = self.size
        pixels = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1)
        seen = (pixels - self.centre) / self.focal
        if not self.distortion.any():
            return np.asarray(seen)
        true = seen.copy()
        for _ in range(_STEPS):
            true = true + seen - self.distorted(true)
        miss = float(np.abs(self.distorted(true) - seen).max())
        if not miss < 1e-6:
            raise DatasetError(
                f"the camera's distortion {self.distortion.tolist()} cannot be removed at its edge "
                f"({miss:.1g} of the focal length remain); expected less of it: crop the images"
            )
        return true

    def distorted(self, slopes: FloatArray) -> FloatArray:
        """Slopes (..., 2) as the lens shows them, from the true ones."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        x, y = slopes[..., 0], slopes[..., 1]
        r = x * x + y * y
        radial = (1 + r * (k1 + r * (k2 + r * k3))) / (1 + r * (k4 + r * (k5 + r * k6)))
        return np.stack(
            [
                x * radial + 2 * p1 * x * y + p2 * (r + 2 * x * x),
                y * radial + p1 * (r + 2 * y * y) + 2 * p2 * x * y,
            ],
            axis=-1,
        )
