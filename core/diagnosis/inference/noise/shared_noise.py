"""Noise that the points of a patch share within one cloud.

Depth filters smooth over neighbours, fill holes with copies and median pixels, so that a patch's
average has more noise than its points' spread and number tell. The average of points n in each of
two clouds of a phantom that nobody touches differs by a variance of spread^2 (1/n + 1/n') + 2
shared^2. Successive clouds are compared, so that a slow motion hardly counts.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import PointSample, Prediction
from palpate.foundation.arrays import FloatArray

__all__ = ["clouds_in_patches", "shared_noise"]


def shared_noise(predictions: Sequence[Prediction]) -> float:
    """Variance that the points of a patch share in a cloud, over the variance of single points [1].

    Zero where it is within `CRITERIA.noise.shared_significance` standard errors of zero, and where
    no untouched group has two clouds.
    """
    excess: list[FloatArray] = []
    weight: list[FloatArray] = []
    for item in predictions:
        pairs = zip(item.samples, item.equilibria, strict=bool(item.samples))
        for sample, frame in pairs:
            if not frame.in_contact and len(sample.cloud):
                own = _successive(sample, item.gap.shape[1])
                excess.append(own[0])
                weight.append(own[1])
    weights = np.concatenate(weight) if weight else np.empty(0)
    if not len(weights):
        return 0.0
    value = float(np.sum(weights * np.concatenate(excess)) / (2 * weights.sum()))
    # Two successive squared differences of white noise have a correlation of 1/4.
    error = float(np.sqrt(1.5 / (2 * weights.sum())))
    return value if value > CRITERIA.noise.shared_significance * error else 0.0


def _successive(sample: PointSample, patches: int) -> tuple[FloatArray, FloatArray]:
    """Squared differences of successive clouds' patch averages, over the variance of single points,
    minus what that variance gives (d,) [1], and their weights (d,).
    """
    clouds = int(sample.cloud.max()) + 1
    cell = sample.cloud.astype(np.int64) * patches + sample.patch
    count = np.bincount(cell, minlength=clouds * patches).reshape(clouds, patches)
    total = np.bincount(cell, sample.gap, minlength=clouds * patches).reshape(clouds, patches)
    mean = total / np.maximum(count, 1)
    within = (sample.gap - mean.ravel()[cell]) ** 2
    freedom = np.maximum(count - 1, 0).sum(axis=0)
    spread = np.bincount(sample.patch, within, minlength=patches) / np.maximum(freedom, 1)
    least = CRITERIA.noise.shared_least_points
    known = (count[1:] >= least) & (count[:-1] >= least)
    known &= (freedom > CRITERIA.noise.least_freedom) & (spread > 0)
    inverse = 1 / np.maximum(count[1:], 1) + 1 / np.maximum(count[:-1], 1)
    # The mean of 1 / spread is freedom / (freedom - 2) times that of the true variance.
    precision = (1 - 2 / np.maximum(freedom, 3)) / np.maximum(spread, 1e-30)
    excess = (mean[1:] - mean[:-1]) ** 2 * precision - inverse
    return excess[known], 1 / inverse[known] ** 2


def clouds_in_patches(prediction: Prediction) -> FloatArray:
    """Number of clouds behind each average (g, p); one where it is not known."""
    patches = prediction.gap.shape[1]
    found = np.ones((len(prediction.equilibria), patches))
    for row, sample in enumerate(prediction.samples):
        if len(sample.cloud):
            cell = np.unique(sample.cloud.astype(np.int64) * patches + sample.patch)
            found[row] = np.maximum(np.bincount(cell % patches, minlength=patches), 1)
    return found
