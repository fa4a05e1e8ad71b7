"""A verdict of none is checked on held-out sequences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, FINER_GRID, GRID, SETUP, poked, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.validation.held_out_check import check_held_out
from palpate.setup.setup import Material

STATED = replace(SETUP, landmarks=CORNERS)
SOFTER = replace(
    STATED, material=Material(young_modulus=STATED.material.young_modulus, poisson_ratio=0.2)
)


DATA = {
    one.name: one
    for one in (poked("fitted", STATED, 0), poked("alike", STATED, 10), poked("other", SOFTER, 20))
}


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with Workers(list(DATA.values()), 1) as workers:
        yield evaluator_of(STATED, registration(), workers, ["fitted"], None, GRID, FINER_GRID)


def test_held_out_sequences_without_error_are_clear(evaluator: Evaluator) -> None:
    found = check_held_out(evaluator, [DATA["alike"]], seed=0)
    assert found is not None and [item.name for item in found.model.predictions] == ["alike"]
    assert not found.structure.significant


def test_error_in_held_out_sequences_alone_is_found(evaluator: Evaluator) -> None:
    found = check_held_out(evaluator, [DATA["alike"], DATA["other"]], seed=0)
    assert found is not None and found.structure.significant
    assert evaluator.state.noises == [] and evaluator.problem.names == (
        "fitted",
    )  # nothing of it reaches what is fitted


def test_without_held_out_sequences_there_is_no_check(evaluator: Evaluator) -> None:
    assert check_held_out(evaluator, [], seed=0) is None
