"""Errors of single patches in single groups, such as what a camera's filter makes up in a hole.

A driver that fills holes copies readings from the rim of the hole. The patch there is off by
millimetres in this group and right in the next, and its neighbours are right. No deformation does
that: it moves neighbours alike, and a dent at another place makes steps at many patches at once.
"""

from __future__ import annotations

import numpy as np
from scipy.stats import norm

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.outlier_patches import neighbours
from palpate.foundation.arrays import FloatArray
from palpate.measurement.patch_averages import MaskArray
from palpate.setup.phantom_geometry import Surface

__all__ = ["isolated_errors"]


def isolated_errors(gap: FloatArray, weights: FloatArray, surface: Surface) -> MaskArray:
    """Return the averages (g, p) that differ from their neighbours' as noise cannot.

    An average is compared with the median of the neighbours in its group, once as it is and once
    less what its patch has in most groups, and must differ both times. So neither the camera's
    pattern is found, nor the untouched group of a patch that most groups touch. It differs where
    the smaller difference is more than `CRITERIA.noise.isolated` standard deviations, or as many
    times what the neighbours usually differ, where that is larger. `CRITERIA.noise.calm_share` is
    the quantile that counts as usual: a dent shows in more neighbours than the rest. What is found
    is no neighbour any more, and the rest is looked through again, until nothing is found.

    Args:
        gap: averages of the baseline (g, p) [m]; NaN where unseen.
        weights: their inverse variances (g, p) [1/m^2]; zero where they do not count.
        surface: with the patches.
    """
    near, found = _numbered(surface), np.zeros(gap.shape, dtype=bool)
    share = CRITERIA.noise.calm_share
    while True:
        known = np.where((weights > 0) & ~found, gap, np.nan)
        moved = known - _quantiles(known.T, 0.5)
        apart = _apart(moved, near) * np.sqrt(weights)
        usual = _quantiles(_gathered(apart, near), share) / norm.ppf(0.5 + 0.5 * share)
        least = np.minimum(apart, _apart(known, near) * np.sqrt(weights))
        further = least > CRITERIA.noise.isolated * np.fmax(usual, 1.0)
        if not further.any():
            return found
        found |= further


def _apart(values: FloatArray, near: np.ndarray) -> FloatArray:
    """Return how far values (g, p) lie from the median of their neighbours (g, p)."""
    return np.abs(values - _quantiles(_gathered(values, near), 0.5))


def _numbered(surface: Surface) -> np.ndarray:
    """Return the numbers of each patch's neighbours (p, n), filled up with p."""
    near = neighbours(surface.patch_centres, surface.patch_normals)
    order = np.argsort(~near, axis=1, kind="stable")[:, : int(near.sum(axis=1).max())]
    return np.where(np.take_along_axis(near, order, axis=1), order, len(near))


def _gathered(values: FloatArray, near: np.ndarray) -> FloatArray:
    """Return the neighbours' values (g, p, n) of values (g, p)."""
    padded = np.concatenate([values, np.full((len(values), 1), np.nan)], axis=1)
    return np.asarray(padded[:, near])


def _quantiles(values: FloatArray, share: float) -> FloatArray:
    """Return the quantiles along the last axis, without NaN; NaN where there is nothing else.

    NumPy's own takes a hundred times as long on many short rows.
    """
    ordered = np.sort(values, axis=-1)
    last = np.isfinite(ordered).sum(axis=-1) - 1
    place = share * np.maximum(last, 0)
    low = place.astype(int)
    high = np.minimum(low + 1, np.maximum(last, 0))
    below, above = (
        np.take_along_axis(ordered, index[..., None], axis=-1)[..., 0] for index in (low, high)
    )
    return np.asarray(below + (place - low) * (above - below))
