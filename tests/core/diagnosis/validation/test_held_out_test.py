"""An all-clear is looked at on the sequences that nothing was fitted on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from pushed_block import CORNERS, SETUP, observed, poke, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.validation.held_out_test import check_held_out
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
def bench() -> Iterator[Bench]:
    with Workers(list(DATA.values()), 1) as workers:
        yield Bench(STATED, registration(), workers, ["fitted"], None, GRID, FINE)


def test_what_holds_for_them_too_is_clear(bench: Bench) -> None:
    found = check_held_out(bench, [DATA["alike"]], seed=0)
    assert found is not None and [item.name for item in found.model.predictions] == ["alike"]
    assert not found.structure.significant


def test_error_that_only_they_show_is_seen(bench: Bench) -> None:
    found = check_held_out(bench, [DATA["alike"], DATA["other"]], seed=0)
    assert found is not None and found.structure.significant
    assert bench.noises == [] and bench.names == ("fitted",)  # nothing of it reaches what is fitted


def test_without_test_sequences_there_is_nothing_to_look_at(bench: Bench) -> None:
    assert check_held_out(bench, [], seed=0) is None
