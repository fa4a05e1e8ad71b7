"""Test sequences confirm a cause that they share with the fitted ones, and no other."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, FINER_GRID, GRID, SETUP, poked, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.gauss_newton import refit
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.diagnosis.validation.held_out_evidence import gain_on_held_out
from palpate.diagnosis.validation.rejection import rejection_reason
from palpate.effects.elastic_material import PoissonRatio

STATED = replace(SETUP, landmarks=CORNERS)
TRUE = PoissonRatio(nu=0.25)


DATA = {
    one.name: one
    for one in (
        poked("fitted-1", TRUE.apply(STATED), 0),
        poked("fitted-2", TRUE.apply(STATED), 1),
        poked("alike", TRUE.apply(STATED), 10),
        poked("without", STATED, 20),
    )
}


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with Workers(list(DATA.values()), 1) as workers:
        names = ["fitted-1", "fitted-2"]
        yield evaluator_of(STATED, registration(), workers, names, None, GRID, FINER_GRID)


def test_only_sequences_with_the_cause_confirm_it(evaluator: Evaluator) -> None:
    stated = evaluator.baseline((), inclusion_places(evaluator.problem))
    found = refit(evaluator, [PoissonRatio(nu=0.3)], stated.predictions)
    alike, without = (
        gain_on_held_out(evaluator, stated, found, [DATA[name]]) for name in ("alike", "without")
    )
    assert alike is not None and without is not None
    assert alike > 5.0 > -5.0 > without
    assert gain_on_held_out(evaluator, stated, found, []) is None


@pytest.mark.parametrize(
    ("fitted", "tested", "named"), [(18.0, 9.0, True), (18.0, 2.0, False), (18.0, None, False)]
)
def test_faint_cause_is_named_if_all_data_together_reach_the_bound(
    evaluator: Evaluator, fitted: float, tested: float | None, named: bool
) -> None:
    stated = evaluator.baseline((), inclusion_places(evaluator.problem))
    model = replace(stated, effects=(TRUE,))
    best = Trial(model, fitted, 1.0, required_gain=12.0)
    findings = Findings(stated, best, [best], bound=25.0, test_gain=tested)
    assert findings.faint
    why = rejection_reason(findings, None)
    assert (why == "") is named
    if not named:
        assert "25 in all are asked for" in why and "hint" in why
