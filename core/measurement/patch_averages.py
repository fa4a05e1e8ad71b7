"""Robust averages of noisy values over patches of a surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = [
    "MaskArray",
    "PatchMeans",
    "patch_means",
    "patch_medians",
    "plain_means",
    "within_spread",
]

MaskArray = np.ndarray[Any, np.dtype[np.bool_]]


@dataclass(frozen=True, eq=False)
class PatchMeans:
    """Averages over patches.

    Attributes:
        mean: (p,) [m]; NaN with fewer than the least number of points.
        count: (p,) number of points.
        spread: (p,) standard deviation of the points [m].
    """

    mean: FloatArray
    count: IntArray
    spread: FloatArray


def patch_medians(values: FloatArray, patch: IntArray, patches: int) -> FloatArray:
    """Medians (p,) of values (m,) by patch (m,); NaN for an empty patch."""
    order, count = np.lexsort((values, patch)), np.bincount(patch, minlength=patches)
    found, seen, first = np.full(patches, np.nan), count > 0, np.cumsum(count) - count
    lower, upper = (order[first[seen] + (count[seen] - less) // 2] for less in (1, 0))
    found[seen] = (values[lower] + values[upper]) / 2
    return found


def within_spread(values: FloatArray, patch: IntArray, patches: int) -> MaskArray:
    """Mask (m,) of values within four robust deviations of their patch's median.

    All patches share one deviation, that of differences within patches, which is unbiased for
    patches of any size. A deviation from the median would be too small for patches of three points
    and would reject good ones.
    """
    if not len(values):
        return np.zeros(0, dtype=bool)
    order = np.argsort(patch, kind="stable")
    count = np.bincount(patch, minlength=patches)
    size, first, ordered = (
        count[patch[order]],
        (np.cumsum(count) - count)[patch[order]],
        values[order],
    )
    # Each value is compared with the one half a patch before it, cyclically; a patch of one point
    # has no difference.
    ring = first + (np.arange(len(order)) - first - size // 2) % size
    apart = np.abs(ordered - ordered[ring])[size > 1]
    scale = 1.4826 / np.sqrt(2) * float(np.median(apart)) if len(apart) else np.inf
    centre = patch_medians(values, patch, patches)
    return np.asarray(np.abs(values - centre[patch]) <= 4 * scale)


def plain_means(values: FloatArray, patch: IntArray, patches: int, least: int = 2) -> PatchMeans:
    """Averages of values (m,) [m] by patch (m,)."""
    count = np.bincount(patch, minlength=patches)
    total = np.bincount(patch, values, minlength=patches)
    square = np.bincount(patch, values**2, minlength=patches)
    with np.errstate(invalid="ignore", divide="ignore"):
        mean = np.where(count >= least, total / count, np.nan)
        spread = np.sqrt(
            np.maximum(square / count - (total / count) ** 2, 0) * count / np.maximum(count - 1, 1)
        )
    return PatchMeans(mean, count, spread)


def patch_means(values: FloatArray, patch: IntArray, patches: int, least: int = 2) -> PatchMeans:
    """Averages of values (m,) [m] by patch (m,), without values more than four robust deviations
    from the patch's median.
    """
    inlier = within_spread(values, patch, patches)
    return plain_means(values[inlier], patch[inlier], patches, least)
