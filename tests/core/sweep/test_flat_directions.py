"""Flat directions from sums of known distribution over the pushes."""

from __future__ import annotations

import numpy as np

from palpate.sweep.flat_directions import assess_direction


def sums(squares: np.ndarray) -> np.ndarray:
    """Return sums (k, p, 4) of one point per push with these squared errors (k, p)."""
    ones = np.ones_like(squares)
    return np.stack([squares, ones, squares, ones], axis=-1)


def test_noise_between_pushes_is_flat_and_a_change_in_all_pushes_is_not() -> None:
    rng = np.random.default_rng(0)
    base = 1e-7 * (1 + 0.5 * rng.random(12))
    noisy = np.stack([base * (1 + 0.2 * rng.standard_normal(12)) for _ in range(5)])
    assert assess_direction("a", range(5), sums(noisy), "distance", 0).flat
    assert (
        assess_direction(
            "a", range(5), sums(noisy * np.array([1, 1.2, 1.5, 2, 3])[:, None]), "distance", 0
        ).flat
        is False
    )
    assert (
        assess_direction("a", range(2), sums(np.array([[1e-7], [2e-7]])), "distance", 0).flat
        is None
    )
