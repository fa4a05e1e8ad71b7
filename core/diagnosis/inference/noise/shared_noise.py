"""Noise that the points of a patch share within one cloud.

Depth filters smooth over neighbours, fill holes with copies and median pixels, so that a patch's
average has more noise than its points' spread and number tell. The average of points n in each of
two clouds of a phantom that nobody touches differs by a variance of spread^2 (1/n + 1/n') + 2
shared^2. Successive clouds are compared, so that a slow motion hardly counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import PointSample, Prediction
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["clouds_in_patches", "shared_noise"]


def shared_noise(predictions: Sequence[Prediction]) -> float:
    """Variance that the points of a patch share in a cloud, over the variance of single points [1].

    Zero where it is within `CRITERIA.noise.shared_significance` standard errors of zero, and where
    no untouched group has two clouds.
    """
    clear = [
        (sample, item.gap.shape[1])
        for item in predictions
        for sample, frame in zip(item.samples, item.equilibria, strict=bool(item.samples))
        if not frame.in_contact and len(sample.cloud)
    ]
    if not clear:
        return 0.0
    clouds = [_Clouds.of(sample, patches) for sample, patches in clear]
    freedom = np.sum([one.freedom for one in clouds], axis=0)
    spread = np.sum([one.within for one in clouds], axis=0) / np.maximum(freedom, 1)
    known = (freedom > CRITERIA.noise.least_freedom) & (spread > 0)
    # The mean of 1 / spread is freedom / (freedom - 2) times that of the true variance.
    precision = np.where(known, (1 - 2 / np.maximum(freedom, 3)) / np.maximum(spread, 1e-30), 0.0)
    pairs = [one.successive(precision) for one in clouds]
    excess, weights = (np.concatenate(part) for part in zip(*pairs, strict=True))
    if not len(weights):
        return 0.0
    value = float(weights @ excess) / (2 * float(weights.sum()))
    # Two successive squared differences of white noise have a correlation of 1/4.
    error = float(np.sqrt(1.5 / (2 * weights.sum())))
    return value if value > CRITERIA.noise.shared_significance * error else 0.0


@dataclass(frozen=True, eq=False)
class _Clouds:
    """Averages of one untouched group by cloud and patch.

    Attributes:
        mean: (c, p) [m].
        count: (c, p) number of points.
        within: (p,) sum of squares about the averages [m^2].
        freedom: (p,) its degrees of freedom.
    """

    mean: FloatArray
    count: IntArray
    within: FloatArray
    freedom: IntArray

    @classmethod
    def of(cls, sample: PointSample, patches: int) -> _Clouds:
        """Average the points of a sample."""
        clouds, gap = int(sample.cloud.max()) + 1, sample.gap.astype(float)
        cell = sample.cloud.astype(np.int64) * patches + sample.patch
        count = np.bincount(cell, minlength=clouds * patches)
        mean = np.bincount(cell, gap, minlength=clouds * patches) / np.maximum(count, 1)
        squares = np.bincount(sample.patch, (gap - mean[cell]) ** 2, minlength=patches)
        within = np.asarray(squares, dtype=float)
        shape = (clouds, patches)
        freedom = np.maximum(count.reshape(shape) - 1, 0).sum(axis=0)
        return cls(mean.reshape(shape), count.reshape(shape), within, freedom)

    def successive(self, precision: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Squared differences of successive averages in units of the points' variance, minus what
        that variance gives (d,) [1], and their weights (d,).

        Args:
            precision: (p,) one over the variance of single points [1/m^2]; zero where unknown.
        """
        known = (self.count[1:] > 0) & (self.count[:-1] > 0) & (precision > 0)
        inverse = 1 / np.maximum(self.count[1:], 1) + 1 / np.maximum(self.count[:-1], 1)
        excess = (self.mean[1:] - self.mean[:-1]) ** 2 * precision - inverse
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
