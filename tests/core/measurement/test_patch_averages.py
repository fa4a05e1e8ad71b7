"""Robust averages over patches."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.measurement.patch_averages import patch_means, plain_means, within_spread


def test_patch_means_find_the_level_among_outliers():
    rng = np.random.default_rng(8)
    level = rng.normal(0, 1e-3, 40)
    patch = rng.integers(0, 40, 8000)
    values = level[patch] + 3e-4 * rng.normal(size=8000)
    values[rng.random(8000) < 0.05] += 6e-3
    means = patch_means(values, patch, 40)
    assert np.abs(means.mean - level).max() < 1e-4
    assert means.spread == pytest.approx(3e-4, rel=0.3)
    assert 0.90 * 8000 < means.count.sum() < 0.96 * 8000


def test_patches_with_too_few_points_have_no_mean():
    means = patch_means(np.array([1e-3, 1.1e-3, 5e-4]), np.array([0, 0, 2]), 4)
    assert np.isnan(means.mean).tolist() == [False, True, True, True]
    assert means.count.tolist() == [2, 0, 1, 0]
    empty = patch_means(np.empty(0), np.empty(0, dtype=int), 3)
    assert np.isnan(empty.mean).all() and not empty.count.any()


def test_patches_with_one_point_do_not_empty_the_others():
    rng = np.random.default_rng(9)
    patch = np.concatenate([np.repeat(np.arange(5), 8), np.arange(5, 100)])
    means = patch_means(1e-3 + 2e-4 * rng.normal(size=len(patch)), patch, 100)
    assert np.allclose(means.mean[:5], 1e-3, atol=3e-4)
    pairs = patch_means(np.array([1e-3, 1.2e-3]), np.array([0, 0]), 1)
    assert pairs.mean[0] == pytest.approx(1.1e-3)


@pytest.mark.parametrize("points", [2, 3, 4, 5, 8])
def test_averages_of_few_points_scatter_as_much_as_the_points_say(points: int):
    """A rejection of good points in small patches would underestimate the noise floor."""
    patches = 6000
    values, patch = (
        np.random.default_rng(points).normal(size=patches * points),
        np.repeat(np.arange(patches), points),
    )
    inlier = within_spread(values, patch, patches)
    means = plain_means(values[inlier], patch[inlier], patches)
    assert (~inlier).mean() < 1e-3
    whole = means.count == points
    squares = means.mean[whole] ** 2 * points / np.average(means.spread[whole] ** 2)
    assert squares.mean() == pytest.approx(
        1.0, abs=4 * np.sqrt(2 * (1 + 1 / (points - 1)) / patches)
    )


def test_a_stray_point_of_a_small_patch_is_left_out():
    values, patch = np.random.default_rng(1).normal(size=600), np.repeat(np.arange(200), 3)
    values[::30] += 12.0
    inlier = within_spread(values, patch, 200)
    assert not inlier[::30].any()
    assert inlier.sum() >= 578
