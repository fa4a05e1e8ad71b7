"""Logarithm and exponential of strains, against eigenvalues."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.fem.strain_tensors import cauchy_green, from_log_strain, log_strain


def test_log_strain_is_that_of_the_stretches_and_is_inverted():
    random = np.random.default_rng(3)
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    for stretches in ((1.3, 0.8, 1.1), (1.2, 1.2, 0.7), (1.5, 1.5, 1.5)):
        c = cauchy_green((turn * np.array(stretches))[None])
        logs = np.log(stretches) - np.log(stretches).mean()
        wanted = (turn * logs) @ turn.T
        found = log_strain(c)
        assert found[0] == pytest.approx(wanted[[0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]], abs=1e-12)
        volume = np.prod(stretches) ** (2 / 3)
        assert from_log_strain(found) * volume == pytest.approx(c, abs=1e-12)


def test_small_strains_agree_with_their_eigenvalues():
    random = np.random.default_rng(4)
    for size in (1e-6, 1e-3, 0.02, 0.0299, 0.0301):
        away = random.standard_normal((3, 3))
        away = away + away.T
        c = np.eye(3) + size * away / np.linalg.norm(away)
        values, axes = np.linalg.eigh(c)
        logs = 0.5 * (np.log(values) - np.log(values).mean())
        rows = [0, 1, 2, 1, 0, 0], [0, 1, 2, 2, 2, 1]
        found = log_strain(c[rows][None])
        assert found[0] == pytest.approx(((axes * logs) @ axes.T)[rows], abs=2e-14)
        assert from_log_strain(found)[0] == pytest.approx(
            ((axes * np.exp(2 * logs)) @ axes.T)[rows], abs=2e-14
        )


def test_only_strains_certainly_below_the_bound_are_left_out():
    c = cauchy_green(np.eye(3) + 0.1 * np.random.default_rng(5).standard_normal((500, 3, 3)))
    whole = log_strain(c)
    size = np.sqrt(np.einsum("mc,mc,c->m", whole, whole, [1, 1, 1, 2, 2, 2]))
    least = np.random.default_rng(6).uniform(0.1, 3.0, 500) * size
    found = log_strain(c, least)
    left_out = ~found.any(axis=1)
    assert 100 < left_out.sum() < 400
    assert (least[left_out] > size[left_out]).all()
    assert np.array_equal(found[~left_out], whole[~left_out])
