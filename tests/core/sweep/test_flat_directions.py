"""Flat directions from sums of known distribution over the pushes."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.sweep.flat_directions import assess_direction, assess_gain


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


def curve(middle: float, rng: np.random.Generator, depth: float = 4.0) -> np.ndarray:
    """Squared errors (7, 10) [m^2] of pushes whose least lies at a value between 0 and 6."""
    own = middle + 0.3 * rng.standard_normal(10)
    places = np.arange(7.0)[:, None]
    return 1e-8 * (4.0 + depth * (places - own) ** 2 / 9.0)


@pytest.mark.parametrize("middle", [1.4, 3.0, 4.7])
def test_interval_of_the_least_holds_where_the_pushes_put_it(middle: float) -> None:
    found = []
    for seed in range(40):
        squares = curve(middle, np.random.default_rng(seed))
        one = assess_direction("a", range(7), sums(squares), "distance", 0)
        assert one.least is not None and not one.edge and one.flat is False
        found.append(one.least[0] <= middle <= one.least[1])
        assert one.least[1] - one.least[0] < 1.0
    assert np.mean(found) > 0.8


def test_least_at_an_end_of_the_range_is_said() -> None:
    rng = np.random.default_rng(1)
    one = assess_direction("a", range(7), sums(curve(-2.0, rng)), "distance", 0)
    other = assess_direction("a", range(7), sums(curve(8.0, rng)), "distance", 0)
    assert (one.edge, other.edge) == ("low", "high")


def test_sure_change_that_removes_hardly_anything_matters_little() -> None:
    squares = curve(3.0, np.random.default_rng(0), depth=0.05)
    one = assess_direction("a", range(7), sums(squares), "distance", 0)
    assert one.flat is False and one.little and one.size < 1e-4
    assert not assess_direction("a", range(7), sums(100 * squares), "distance", 0).little


def test_gain_of_chance_is_none_and_of_all_pushes_is() -> None:
    rng = np.random.default_rng(0)
    before = sums(1e-8 * (1 + 0.2 * rng.random((1, 12))))[0]
    chance = before * (1 + 0.05 * rng.standard_normal((12, 1)) * [1, 0, 1, 0])
    gain = assess_gain(before, chance, 20, "distance", 0)
    assert gain["low"] < 0 < gain["high"]
    assert assess_gain(before, before * [0.5, 1, 0.5, 1], 20, "distance", 0)["low"] > 0
    assert assess_gain(before[:1], before[:1] * [0.5, 1, 0.5, 1], 20, "distance", 0)["low"] < 0
