from __future__ import annotations

import numpy as np
import pytest
from linear_blocks import linear_blocks
from pushed_block import SETUP
from scipy.stats import ks_2samp

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block, log_evidence, predictive_score
from palpate.diagnosis.search.chance_gains import ChanceGains
from palpate.diagnosis.search.screening import Candidate, linear_gains, pair_gains, right_sides
from palpate.effects import Effect
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.load import Gravity
from palpate.effects.tool import ToolOffset, ToolRadius
from palpate.foundation.arrays import FloatArray

GROUPS, PATCHES, SEQUENCES = 6, 25, 4
NUISANCE, KNOWN = (0, 1, 2), np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 4.0]])
LUMPS = range(3, 15)
CATALOGUE = [
    *(
        Candidate(start=StiffInclusion.neutral(SETUP), columns=(column,), spread=(2.0,))
        for column in LUMPS
    ),
    Candidate(start=ToolOffset.neutral(SETUP), widened={0: 5.0, 1: 5.0}),
    Candidate(start=ToolRadius.neutral(SETUP), widened={2: 3.0}),
]


def _columns() -> list[FloatArray]:
    """Smooth-ish columns (g, p, k) of each sequence; neighbours are alike, as lumps are."""
    random = np.random.default_rng(0)
    raw = random.standard_normal((SEQUENCES, GROUPS, PATCHES, 16))
    return list(raw[..., :15] + 0.8 * raw[..., 1:])


COLUMNS = _columns()


def _blocks(causes: dict[int, float], seed: int) -> list[Block]:
    return linear_blocks(COLUMNS, NUISANCE, KNOWN, causes, seed)


def _gains(blocks: list[Block]) -> FloatArray:
    return linear_gains(blocks, right_sides(blocks), NUISANCE, KNOWN, CATALOGUE)[0]


def test_linear_gains_are_differences_of_predictive_scores():
    blocks = _blocks({5: 0.2}, seed=1)
    without = predictive_score(blocks, NUISANCE, KNOWN, stated=3).sum()
    found = _gains(blocks)
    for number in range(len(LUMPS)):
        columns, precision = CATALOGUE[number].precision(list(NUISANCE), KNOWN)
        assert found[number] == pytest.approx(
            predictive_score(blocks, columns, precision, stated=3).sum() - without, abs=1e-8
        )


def test_wider_prior_is_judged_against_the_same_flat_one():
    blocks = _blocks({0: 4.0}, seed=2)
    found = _gains(blocks)
    for number in (-2, -1):
        columns, precision = CATALOGUE[number].precision(list(NUISANCE), KNOWN)
        assert columns == list(NUISANCE)
        covariance = np.linalg.inv(KNOWN) + np.diag(
            [CATALOGUE[number].widened.get(c, 0.0) ** 2 for c in NUISANCE]
        )
        assert np.allclose(precision, np.linalg.inv(covariance))
        scores = [
            predictive_score(blocks, NUISANCE, prior, stated=3)[:-1].sum()
            for prior in (precision, KNOWN)
        ]
        evidence = [log_evidence(blocks, NUISANCE, prior) for prior in (precision, KNOWN)]
        assert found[number] == pytest.approx(
            scores[0] + evidence[0] - scores[1] - evidence[1], abs=1e-8
        )
    assert log_evidence(blocks, NUISANCE, CRITERIA.priors.flat_factor * KNOWN) < evidence[0]


def _best_by_chance(
    blocks: list[Block], draws: int, seed: int, catalogue: list[Candidate] = CATALOGUE
) -> FloatArray:
    return ChanceGains.drawn(blocks, NUISANCE, KNOWN, catalogue, draws, seed).best


def test_chance_stays_below_its_own_quantile_in_fresh_data():
    blocks = _blocks({}, seed=3)
    bound = np.quantile(_best_by_chance(blocks, 1000, 4), 0.99)
    # Fresh data are made of residuals, not of the Gram matrices that the null draws come from.
    rights = np.concatenate([right_sides(_blocks({}, seed)) for seed in range(100, 900)])
    best = linear_gains(blocks, rights, NUISANCE, KNOWN, CATALOGUE).max(axis=1)
    assert 0.975 < np.mean(best < bound) < 0.999
    assert np.median(best) < 0.5 * bound


def test_null_draws_are_distributed_like_fresh_data():
    # Wider priors only: here the nuisances' own stated deviations decide.
    wide = [
        Candidate(start=ToolOffset.neutral(SETUP), widened={0: 2.0, 1: 2.0}),
        Candidate(start=ToolRadius.neutral(SETUP), widened={2: 2.0}),
    ]
    drawn = _best_by_chance(_blocks({}, seed=3), 1000, 4, wide)
    blocks = _blocks({}, seed=3)
    rights = np.concatenate([right_sides(_blocks({}, seed)) for seed in range(100, 600)])
    fresh = linear_gains(blocks, rights, NUISANCE, KNOWN, wide).max(axis=1)
    assert ks_2samp(drawn, fresh).pvalue > 0.01


def test_planted_column_is_found_far_above_chance():
    blocks = _blocks({9: 0.5}, seed=5)
    gains = _gains(blocks)
    bound = np.quantile(_best_by_chance(blocks, 200, 6), 0.99)
    assert np.argmax(gains) == 9 - LUMPS[0]
    assert gains.max() > 3 * bound


def test_two_causes_that_a_third_looks_like_are_found_as_a_pair():
    roughly = [own[..., [5]] + own[..., [9]] + 0.5 * own[..., [12]] for own in COLUMNS]
    blocks = linear_blocks(
        [np.concatenate(both, axis=2) for both in zip(COLUMNS, roughly, strict=True)],
        NUISANCE,
        KNOWN,
        {5: 0.3, 9: 0.3},
        10,
    )
    kinds: dict[int, type[Effect]] = {5: ToolOffset, 9: ToolRadius, 15: StiffInclusion, 7: Gravity}
    catalogue = [
        Candidate(start=kind.neutral(SETUP), columns=(c,), spread=(2.0,))
        for c, kind in kinds.items()
    ]
    alone = linear_gains(blocks, right_sides(blocks), NUISANCE, KNOWN, catalogue)[0]
    assert catalogue[int(np.argmax(alone))].columns == (15,)
    gain, one, other = pair_gains(blocks, right_sides(blocks), NUISANCE, KNOWN, catalogue)[0]
    assert {one.columns, other.columns} == {(5,), (9,)}
    together, precision = one.beside(other).precision(list(NUISANCE), KNOWN)
    without = predictive_score(blocks, NUISANCE, KNOWN, stated=3).sum()
    assert gain == pytest.approx(
        predictive_score(blocks, together, precision, stated=3).sum() - without, abs=1e-8
    )
    more = gain - alone.max()
    assert (
        len(pair_gains(blocks, right_sides(blocks), NUISANCE, KNOWN, catalogue, 0.99 * more)) == 1
    )
    assert not pair_gains(blocks, right_sides(blocks), NUISANCE, KNOWN, catalogue, 1.01 * more)


def test_each_pair_of_effects_comes_once_by_its_best_candidates_and_none_beside_an_only_cause():
    catalogue = [
        Candidate(start=ToolRadius.neutral(SETUP), columns=(9,), spread=(2.0,)),
        *CATALOGUE[:4],
    ]
    lump, radius = CATALOGUE[2].columns[0], 9
    both, one = _blocks({lump: 0.3, radius: 0.3}, seed=11), _blocks({radius: 0.3}, seed=11)
    ((_, first, second),) = pair_gains(both, right_sides(both), NUISANCE, KNOWN, catalogue, 25.0)
    assert {first.columns, second.columns} == {(lump,), (radius,)}
    assert not pair_gains(one, right_sides(one), NUISANCE, KNOWN, catalogue, 25.0)


def test_null_draws_repeat_with_their_seed():
    blocks = _blocks({}, seed=7)
    first, second = (_best_by_chance(blocks, 20, 8) for _ in range(2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, _best_by_chance(blocks, 20, 9))
