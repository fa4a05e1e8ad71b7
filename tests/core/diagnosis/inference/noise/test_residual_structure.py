from __future__ import annotations

import numpy as np
import pytest
from linear_blocks import linear_blocks
from scipy.stats import ks_2samp

from palpate.diagnosis.criteria.tolerance import Tolerance
from palpate.diagnosis.inference.evidence import Block, draw_rights, gram
from palpate.diagnosis.inference.noise.residual_structure import (
    Structure,
    explained_by_modes,
    response_of_modes,
)
from palpate.foundation.arrays import FloatArray

GROUPS, PATCHES, SEQUENCES = 6, 40, 3
FITTED, MODES, CAUSE = (0, 1), range(2, 8), 8
PRECISION = np.diag([2.0, 0.5])


def _columns() -> FloatArray:
    """(s, g, p, k): two nuisances, modes that grow with the push, and a cause that is nearly a sum
    of modes.
    """
    random = np.random.default_rng(0)
    columns = random.standard_normal((SEQUENCES, GROUPS, PATCHES, 9))
    depth = np.linspace(0, 1, GROUPS)[:, None, None]
    modes = random.standard_normal((PATCHES, len(MODES)))
    columns[..., 2:8] = depth * modes
    columns[..., CAUSE] = (depth * modes @ random.standard_normal((len(MODES), 1)))[..., 0]
    return columns


COLUMNS = _columns()


def _blocks(size: float, seed: int) -> list[Block]:
    return linear_blocks(list(COLUMNS), FITTED, PRECISION, {CAUSE: size}, seed)


def _value(blocks: list[Block]) -> float:
    rights = np.array([[block.gram[1:, 0] for block in blocks]])
    return float(explained_by_modes(blocks, rights, FITTED, PRECISION, MODES)[0])


@pytest.fixture(scope="module")
def chance() -> FloatArray:
    blocks = _blocks(0.0, seed=1)
    rights = draw_rights(blocks, FITTED, PRECISION, 600, np.random.default_rng(2))
    return explained_by_modes(blocks, rights, FITTED, PRECISION, MODES)


def test_pure_noise_gives_what_the_draws_give(chance):
    fresh = np.array([_value(_blocks(0.0, seed)) for seed in range(100, 500)])
    assert ks_2samp(chance, fresh).pvalue > 0.01
    assert chance.mean() == pytest.approx(
        SEQUENCES * len(MODES), rel=0.1
    )  # one per mode and sequence, nuisances aside


def test_a_cause_that_grows_with_the_push_stands_out(chance):
    assert _value(_blocks(0.6, seed=3)) > 2 * np.quantile(chance, 0.99)


def test_what_the_nuisances_explain_is_no_structure():
    blocks = _blocks(0.0, seed=4)
    shifted = [
        Block(
            b.name,
            *gram(
                np.zeros((GROUPS, PATCHES)) - 0.5 * columns[..., 0],
                columns,
                np.ones((GROUPS, PATCHES)),
            ),
        )
        for b, columns in zip(blocks, COLUMNS, strict=True)
    ]
    assert _value(shifted) < 0.01 * SEQUENCES * len(MODES)


@pytest.mark.parametrize(("value", "significant"), [(40.0, True), (20.0, False)])
def test_structure_is_judged_by_its_bound(value, significant):
    found = Structure(value, expected=18.0, bound=33.0)
    assert found.significant is significant
    assert found.ratio == pytest.approx(value / 18.0)


def test_size_of_mode_factors_follows_from_what_the_modes_explain():
    random, values = np.random.default_rng(5), []
    for _ in range(400):
        factors = random.standard_normal((SEQUENCES, len(MODES)))
        blocks = [
            Block(
                str(number),
                *gram(-columns[..., list(MODES)] @ own, columns, np.ones((GROUPS, PATCHES))),
            )
            for number, (columns, own) in enumerate(zip(COLUMNS, factors, strict=True))
        ]
        values.append(_value(blocks))
    response = response_of_modes(blocks, FITTED, PRECISION, MODES)
    assert np.mean(values) == pytest.approx(response, rel=0.1)


@pytest.mark.parametrize(
    ("amplitude", "motion", "stated", "matters"),
    [
        (0.09e-3, 1e-3, None, False),
        (0.11e-3, 1e-3, None, True),
        (0.11e-3, 5e-3, None, False),
        (0.11e-3, 5e-3, 0.05e-3, True),
        (np.nan, np.nan, 1e-3, True),
    ],
)
def test_significant_error_matters_beyond_the_tolerance(amplitude, motion, stated, matters):
    found = Structure(40.0, 18.0, 33.0, amplitude, motion)
    assert found.matters(Tolerance(stated)) is matters
    assert not Structure(20.0, 18.0, 33.0, amplitude, motion).matters(Tolerance(stated))
