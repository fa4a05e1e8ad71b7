"""Errors of single patches, on made-up averages of a block's surface."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.diagnosis.inference.noise.isolated_errors import isolated_errors
from palpate.setup.box import Box

SURFACE = Box(size=(0.07, 0.04, 0.036)).surface()
CENTRES = SURFACE.patch_centres
GROUPS, SIGMA = 20, 1e-4
TOP = np.flatnonzero(SURFACE.patch_normals[:, 2] > 0.5)


@pytest.fixture
def gap() -> np.ndarray:
    """Noise, and a pattern that a camera has in every group."""
    noise = SIGMA * np.random.default_rng(5).normal(size=(GROUPS, SURFACE.patches))
    return np.asarray(noise + 5e-4 * np.sin(CENTRES @ [300.0, 200.0, 100.0]))


def found(gap: np.ndarray) -> set[tuple[int, int]]:
    weights = np.where(np.isfinite(gap), SIGMA**-2, 0.0)
    return {
        (int(row), int(patch)) for row, patch in np.argwhere(isolated_errors(gap, weights, SURFACE))
    }


def test_copied_patches_are_found_and_nothing_else(gap: np.ndarray) -> None:
    assert found(gap) == set()
    copied = {(4, int(TOP[30])), (4, int(TOP[90])), (11, int(TOP[60]))}
    for place in copied:
        gap[place] += 2e-3
    assert found(gap) == copied


def test_dent_at_another_place_is_no_error_of_single_patches(gap: np.ndarray) -> None:
    """A tool 1.5 mm off its place makes the left of its dent too deep and the right too high."""
    middle = CENTRES[TOP[len(TOP) // 2]]
    aside = CENTRES - middle
    near = np.exp(-0.5 * (np.linalg.norm(aside, axis=1) / 5e-3) ** 2)
    gap[8:12] += 1.5e-3 * near * aside[:, 0] / 5e-3
    assert np.abs(gap[8:12]).max() > 10 * SIGMA
    assert found(gap) == set()


def test_untouched_groups_of_a_patch_that_most_groups_touch_are_no_errors(gap: np.ndarray) -> None:
    """Under a small tool, a wrong radius shows in one patch: in all groups that touch."""
    gap[3:, TOP[40]] += 6 * SIGMA
    assert found(gap) == set()


def test_patch_that_is_always_off_is_the_cameras_pattern(gap: np.ndarray) -> None:
    gap[:, TOP[40]] += 2e-3
    assert found(gap) == set()


def test_patches_that_are_not_seen_are_neither_errors_nor_neighbours(gap: np.ndarray) -> None:
    gap[:, CENTRES[:, 0] < 0] = np.nan
    gap[3, TOP[CENTRES[TOP, 0] > 0.02][5]] += 2e-3
    assert len(found(gap)) == 1
    assert found(np.full_like(gap, np.nan)) == set()
