"""Bounds of single effects from gains by chance."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.search.chance_gains import ChanceGains

FREEDOM = {"one_number": 1, "three_numbers": 3, "pose": 6}


def _gains(draws: int, seed: int, size: float = 4.0) -> ChanceGains:
    """Gains that are distributed as chi squared, the more freely the more numbers an effect has."""
    random = np.random.default_rng(seed)
    columns = [size * 0.5 * random.chisquare(free, draws) for free in FREEDOM.values()]
    return ChanceGains(tuple(FREEDOM), np.stack(columns, axis=1))


def test_freer_effect_has_a_higher_bound():
    bounds = _gains(400, 0).bounds()
    assert bounds["one_number"] < bounds["three_numbers"] < bounds["pose"]


@pytest.mark.parametrize("seed", range(5))
def test_few_fresh_draws_exceed_the_bounds(seed: int):
    """The share of all effects together is that of `null_quantile`, from 400 draws."""
    fresh = _gains(20_000, 100 + seed)
    share = fresh.named(_gains(400, seed).bounds()) / 20_000
    assert 0.1 < share / (1 - CRITERIA.naming.null_quantile) < 3.0


def test_effect_that_chance_hardly_feeds_needs_the_least_gain():
    assert set(_gains(400, 0, 0.1).bounds().values()) == {CRITERIA.naming.least_confirmed_gain}


def test_nothing_drawn_has_no_bounds():
    assert not ChanceGains().bounds()
    assert not ChanceGains().best.size
