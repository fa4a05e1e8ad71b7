"""A verdict of none is checked on held-out sequences."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, SETUP, observed, poke, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.validation.held_out_check import check_held_out
from palpate.mesh.box_mesh import GridSpec
from palpate.setup.setup import Material, Setup

GRID, FINE = GridSpec(nodes=(9, 7, 6), spacing=2e-3), GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
STATED = replace(SETUP, landmarks=CORNERS)
SOFTER = replace(
    STATED, material=Material(young_modulus=STATED.material.young_modulus, poisson_ratio=0.2)
)


def _pushed(name: str, truth: Setup, seed: int) -> Observations:
    centres = np.array([poke(-6e-3), poke(2e-3), poke(4e-3), poke(6e-3)])
    return replace(observed(truth, centres, count=20000, noise=2e-4, seed=seed), name=name)


DATA = {
    one.name: one
    for one in (
        _pushed("fitted", STATED, 0),
        _pushed("alike", STATED, 10),
        _pushed("other", SOFTER, 20),
    )
}


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with Workers(list(DATA.values()), 1) as workers:
        yield evaluator_of(STATED, registration(), workers, ["fitted"], None, GRID, FINE)


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
