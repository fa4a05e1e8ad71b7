"""Tests of the engine error that a sequence needs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, FINER_GRID, GRID, SETUP, TOP, poked, registration

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.diagnosis.validation.stiffness_error_test import (
    StiffnessError,
    StiffnessErrorTest,
    chance_bound,
    largest_stiffness_error,
    stiffness_error_of,
)
from palpate.diagnosis.validation.worst_location import ErrorLocation
from palpate.effects.base import with_effects
from palpate.effects.elastic_material import StiffInclusion

STATED = replace(SETUP, landmarks=CORNERS)
LUMP = StiffInclusion(x=0.002, y=0.0, z=0.026, radius=7e-3, stiffness_ratio=6.0)


DATA = {
    one.name: one
    for one in (
        poked("clear", STATED, 0),
        poked("alike", STATED, 10),
        poked("lumpy", with_effects(STATED, [LUMP]), 20),
    )
}


@pytest.fixture(scope="module")
def workers() -> Iterator[Workers]:
    with Workers(list(DATA.values()), 1) as found:
        yield found


def _looked_at(workers: Workers, *names: str) -> StiffnessErrorTest:
    evaluator = evaluator_of(STATED, registration(), workers, names, None, GRID, FINER_GRID)
    found = largest_stiffness_error(
        evaluator, evaluator.baseline((), inclusion_places(evaluator.problem))
    )
    assert found is not None
    return found


def test_stated_setup_needs_no_unusual_error(workers: Workers) -> None:
    found = _looked_at(workers, "clear", "alike")
    assert not found.significant and found.warning == "" and found.gain < 0.3 * found.bound


def test_sequence_with_an_error_of_its_own_is_named(workers: Workers) -> None:
    found = _looked_at(workers, "clear", "alike", "lumpy")
    assert found.significant and found.sequence == "lumpy" and found.factor > 2
    x, y, z = found.place.place
    # Straight above the lump the tool is in the way.
    assert np.hypot(x - LUMP.x, y - LUMP.y) < 15e-3 and z == TOP and 0.1 < found.place.share < 0.3
    assert (
        "lumpy would need local stiffness that is off by" in found.warning
        and "4 % at most" in found.warning
    )


GROUPS, PATCHES, NUISANCES, MOVED, SPOTS = 8, 60, 2, 6, 20
FITTED, OWN = [0, 1], MOVED + SPOTS


def _asked(deviation: float, seed: int) -> StiffnessError:
    """Of white noise, nuisances, and errors of local stiffness of this deviation over the allowed
    one.
    """
    random = np.random.default_rng(seed)
    columns = random.standard_normal((GROUPS, PATCHES, NUISANCES + OWN)) * 0.3
    factors = random.standard_normal(NUISANCES + OWN) * np.array(
        [*[1.0] * NUISANCES, *[0.5] * MOVED, *[deviation] * SPOTS]
    )
    residual = columns @ factors + random.standard_normal((GROUPS, PATCHES))
    block = Block("poke", *gram(residual, columns, np.ones((GROUPS, PATCHES))))
    return stiffness_error_of(block, FITTED, np.eye(NUISANCES), OWN, SPOTS)


@pytest.mark.parametrize("deviation", [0.05, CRITERIA.stiffness_error.usual])
def test_usual_error_is_rarely_significant(deviation: float) -> None:
    gains = np.array([_asked(deviation, seed).gain for seed in range(200)])
    assert (gains > chance_bound(1)).sum() <= 2 and np.median(gains) < 0.5


def test_larger_error_is_estimated() -> None:
    found = [_asked(4 * CRITERIA.stiffness_error.usual, seed) for seed in range(20)]
    assert all(one.gain > chance_bound(4) for one in found)
    assert np.median([one.factor for one in found]) == pytest.approx(4.0, rel=0.5)


def test_bound_grows_with_the_number_of_sequences() -> None:
    assert 4.5 < chance_bound(1) < chance_bound(4) < chance_bound(20) < 8.0


def test_warning_states_the_deviation_of_stiffness() -> None:
    found = StiffnessErrorTest("poke-side-01", 4.0, 13.2, 6.1, ErrorLocation((0.0, 0.0, 0.0), 1.0))
    assert (
        f"off by {100 * 4 * CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error:.0f} %"
        in found.warning
        and found.share == 1 - 1 / 16
    )
    assert found.to_json()["deviation"] == pytest.approx(
        4 * CRITERIA.stiffness_error.usual * CRITERIA.noise.stiffness_error
    )
    assert replace(found, gain=5.0).warning == ""
