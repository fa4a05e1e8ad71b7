from __future__ import annotations

import numpy as np
import pytest

from palpate.diagnosis.observation.outlier_patches import _medians, agrees_with_neighbours
from palpate.setup.setup import Box

SURFACE = Box(size=(0.06, 0.04, 0.03)).surface()
HIDDEN = 20


def _cloud(stray: float, points: int, slope: float = 0.0):
    """Gaps [m] with twenty points on every patch of the top but one, which has a few that lie
    `stray` off.
    """
    top = np.flatnonzero(SURFACE.patch_normals[:, 2] > 0.9)
    hidden = top[HIDDEN]
    patch = np.concatenate([np.repeat(np.setdiff1d(top, [hidden]), 20), np.full(points, hidden)])
    gap = slope * SURFACE.patch_centres[patch, 0] + np.random.default_rng(3).normal(
        0.0, 3e-4, len(patch)
    )
    gap[patch == hidden] += stray
    return gap, patch, hidden


@pytest.mark.parametrize("stray", [4e-3, -2e-3])
def test_nearly_hidden_patch_far_from_its_neighbours_is_an_outlier(stray):
    gap, patch, hidden = _cloud(stray, 2)
    kept = agrees_with_neighbours(gap, patch, SURFACE)
    assert not kept[patch == hidden].any()
    assert kept[patch != hidden].all()


def test_well_covered_patch_may_differ_from_its_neighbours():
    gap, patch, _ = _cloud(4e-3, 20)
    assert agrees_with_neighbours(gap, patch, SURFACE).all()


def test_well_covered_patch_that_no_dent_explains_is_an_outlier():
    gap, patch, hidden = _cloud(1.1e-2, 20)
    kept = agrees_with_neighbours(gap, patch, SURFACE)
    assert not kept[patch == hidden].any()
    assert kept[patch != hidden].all()


def test_patch_near_its_neighbours_is_no_outlier_however_wrong_the_model():
    gap, patch, _ = _cloud(0.0, 2, slope=0.1)
    assert np.abs(gap).max() > 2e-3
    assert agrees_with_neighbours(gap, patch, SURFACE).all()


def test_cloud_without_points_has_no_outliers():
    assert len(agrees_with_neighbours(np.zeros(0), np.zeros(0, dtype=int), SURFACE)) == 0


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 1.0])
@pytest.mark.parametrize("count", [1, 2, 5, 60])
def test_medians_of_all_rows_are_those_of_each(count: int, share: float) -> None:
    random = np.random.default_rng(count)
    values, near = random.normal(size=count), random.random((count, count)) < share
    each = [np.median(values[row]) if row.any() else 0.0 for row in near]
    assert np.array_equal(_medians(values, near), each)
