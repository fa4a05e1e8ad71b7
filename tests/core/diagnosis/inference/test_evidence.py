from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.stats import multivariate_normal

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import (
    Block,
    fit,
    gram,
    log_evidence,
    predictive_gain,
    predictive_score,
    within_reach,
)
from palpate.foundation.arrays import FloatArray

GROUPS, PATCHES, COLUMNS = 4, 5, 3
USED = [0, 2]
PRECISION = np.array([[4.0, 1.0], [1.0, 2.0]])


def _data(seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residual (g, p), columns (g, p, k) and weights (g, p), some of them zero."""
    random = np.random.default_rng(seed)
    weights = random.uniform(0.5, 4.0, (GROUPS, PATCHES))
    weights[random.random(weights.shape) < 0.2] = 0.0
    return (
        random.standard_normal((GROUPS, PATCHES)),
        random.standard_normal((GROUPS, PATCHES, COLUMNS)),
        weights,
    )


def _without_constants(
    residual: FloatArray, columns: FloatArray, weights: FloatArray
) -> FloatArray:
    """White values (n, 1 + k) in which no constant of a patch is left: an orthonormal basis across
    all of them.
    """
    seen = weights.ravel() > 0
    root = np.sqrt(weights.ravel())[seen]
    constants = np.tile(np.eye(PATCHES), (GROUPS, 1))[seen] * root[:, None]
    across = null_space(constants[:, np.abs(constants).sum(axis=0) > 0].T)
    stacked = np.concatenate([residual.reshape(-1, 1), columns.reshape(-1, COLUMNS)], axis=1)[seen]
    return np.asarray(across.T @ (root[:, None] * stacked))


def _blocks(*seeds: int) -> tuple[list[Block], list[FloatArray]]:
    """Blocks, and the white values (n, 1 + k) that each was made of."""
    made = [_data(seed) for seed in seeds]
    return [Block(str(seed), *gram(*data)) for seed, data in zip(seeds, made, strict=True)], [
        _without_constants(*d) for d in made
    ]


def _density(values: list[FloatArray], precision: FloatArray) -> float:
    """Log density of white values with the factors of the columns USED integrated out, by the dense
    covariance.
    """
    stacked = np.concatenate(values)
    columns = stacked[:, 1:][:, USED]
    covariance = np.eye(len(stacked)) + columns @ np.linalg.inv(precision) @ columns.T
    return float(multivariate_normal(cov=covariance).logpdf(stacked[:, 0]))


def test_gram_is_that_of_values_without_the_constants_of_patches():
    residual, columns, weights = _data(1)
    matrix, values = gram(residual, columns, weights)
    white = _without_constants(residual, columns, weights)
    assert np.allclose(matrix, white.T @ white, atol=1e-12)
    assert values == len(white)


def test_gram_does_not_change_with_a_constant_of_each_patch():
    residual, columns, weights = _data(2)
    constant = np.random.default_rng(0).standard_normal(PATCHES)
    assert np.allclose(
        gram(residual + constant, columns, weights)[0],
        gram(residual, columns, weights)[0],
        atol=1e-12,
    )


def test_gram_does_not_read_what_is_unseen():
    residual, columns, weights = _data(3)
    hidden = np.where(weights > 0, residual, np.nan)
    assert np.allclose(
        gram(hidden, columns, weights)[0], gram(residual, columns, weights)[0], atol=1e-12
    )


def test_fit_is_ridge_regression_with_a_prior_mean():
    blocks, values = _blocks(4, 5)
    stacked = np.concatenate(values)
    y, a, mean = stacked[:, 0], stacked[:, 1:][:, USED], np.array([0.7, -0.3])
    # The square root of the prior is appended as further rows of data, then plain least squares.
    root = np.linalg.cholesky(PRECISION).T
    wanted = np.linalg.lstsq(
        np.concatenate([a, root]), np.concatenate([-y, root @ mean]), rcond=None
    )[0]
    found = fit(blocks, USED, PRECISION, mean)
    assert np.allclose(found.change, wanted)
    assert np.allclose(found.covariance, np.linalg.inv(a.T @ a + PRECISION))
    assert found.misfit == pytest.approx(float(((y + a @ wanted) ** 2).sum()))


def test_log_evidence_is_the_dense_normal_density_up_to_its_constant():
    blocks, values = _blocks(6, 7, 8)
    count = sum(block.values for block in blocks)
    found = log_evidence(blocks, USED, PRECISION) - 0.5 * count * np.log(2 * np.pi)
    assert found == pytest.approx(_density(values, PRECISION), abs=1e-9)


def test_predictive_score_is_the_density_of_each_block_given_the_others():
    blocks, values = _blocks(9, 10, 11)
    precision = np.diag([4.0, 2.0])  # what is stated and what is searched have priors of their own
    whole = _density(values, precision)
    scores = predictive_score(blocks, USED, precision, stated=1)
    for number, block in enumerate(blocks):
        others = _density([*values[:number], *values[number + 1 :]], precision)
        assert scores[number] - 0.5 * block.values * np.log(2 * np.pi) == pytest.approx(
            whole - others, abs=1e-9
        )
    assert scores[-1] == pytest.approx(
        whole - _density(values, np.diag([4.0 * CRITERIA.priors.flat_factor, 2.0])), abs=1e-6
    )


def test_fit_that_breaks_what_was_stated_is_punished_by_half_the_square_of_its_deviations():
    random = np.random.default_rng(12)
    column = random.standard_normal((GROUPS, PATCHES, 1))
    precision, weights = np.array([[1.0]]), np.full((GROUPS, PATCHES), 1e8)

    def stated(deviations: float) -> float:
        block = Block("poke", *gram(-deviations * column[..., 0], column, weights))
        return float(predictive_score([block, block], [0], precision, stated=1)[-1])

    assert stated(10.0) - stated(0.0) == pytest.approx(-0.5 * 10.0**2, rel=1e-3)
    assert stated(0.5) - stated(0.0) == pytest.approx(-0.5 * 0.5**2, rel=1e-3)


def test_predictive_gain_adds_the_blocks_and_states_their_scatter():
    gain, error = predictive_gain(np.array([4.0, 6.0, 8.0]), np.array([1.0, 1.0, 1.0]))
    assert gain == 15.0
    assert error == pytest.approx(2.0 * np.sqrt(3))


def test_step_within_reach_is_the_best_of_all_that_are_as_short_and_holds_back_what_is_doubtful():
    matrix = np.diag([9.0, 400.0, 0.01])
    right = np.array([0.0, 800.0, 0.5])
    block = Block(
        "a", np.block([[np.array([[3000.0]]), right[None]], [right[:, None], matrix]]), 100.0
    )
    precision, scales = 1e-6 * np.eye(3), np.array([1.0, 1.0])
    whole = fit([block], [0, 1, 2], precision).change
    assert whole[1:] == pytest.approx([-2.0, -50.0], rel=1e-3)
    found = within_reach([block], [0, 1, 2], precision, [1, 2], scales, 2.5)
    assert np.abs(found[1:]).max() <= 2.5
    assert found[1] == pytest.approx(-2.0, rel=2e-3) and -2.5 <= found[2] < -1.5
    assert np.array_equal(within_reach([block], [0, 1, 2], precision, [1, 2], scales, 60.0), whole)

    def left(change: FloatArray) -> float:
        return float(2 * right @ change + change @ (matrix + precision) @ change)

    length = np.linalg.norm(found[1:])
    others = np.random.default_rng(0).standard_normal((200, 2))
    for one in length * others / np.linalg.norm(others, axis=1, keepdims=True):
        assert left(found) <= left(np.array([found[0], *one])) + 1e-9
