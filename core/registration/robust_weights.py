"""Robust noise and weights of distances whose noise lies along the line of sight."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["centred_weights", "depth_noise", "robust_weights"]

HUBER, TUKEY = 1.345, 4.685
"""Tuning constants of the robust weights, in standard deviations; 95 % efficiency."""


def depth_noise(distance: FloatArray, slant: FloatArray) -> float:
    """Robust standard deviation of depth [m], along the line of sight.

    Args:
        distance: from the surface along its normal (k,) [m].
        slant: cosine between normal and line of sight (k,) [1].
    """
    return max(1.0e-5, 1.4826 * float(np.median(np.abs(distance / slant))))


def robust_weights(
    distance: FloatArray, slant: FloatArray, noise: float, *, tukey: bool
) -> FloatArray:
    """Robust weights (k,) [1] of distances scaled by their noise: Huber's, or Tukey's.

    Args:
        distance: as for `depth_noise`.
        slant: as for `depth_noise`.
        noise: standard deviation of depth [m].
        tukey: whether far points have no weight at all.
    """
    scaled = np.abs(distance) / (noise * slant)
    if tukey:
        return np.asarray(np.maximum(0.0, 1 - (scaled / TUKEY) ** 2) ** 2)
    return np.asarray(np.minimum(1.0, HUBER / np.maximum(scaled, 1e-12)))


def centred_weights(part: IntArray, distance: FloatArray, slant: FloatArray) -> FloatArray:
    """Tukey's weights (k,) [1] of distances about the median of their part, so that a part with an
    offset is no outlier.

    Args:
        part: number of each point's part (k,).
        distance: as for `depth_noise`.
        slant: as for `depth_noise`.
    """
    centred = distance.copy()
    for number in np.unique(part):
        centred[part == number] -= np.median(distance[part == number])
    return robust_weights(centred, slant, depth_noise(centred, slant), tukey=True)
