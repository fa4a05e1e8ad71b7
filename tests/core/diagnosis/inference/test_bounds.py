"""What lies at a bound gains nothing by what lies beyond it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from evaluating import evaluator_of
from linear_blocks import linear_blocks
from pushed_block import SETUP, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.effects import Effect
from palpate.effects.load import Gravity
from palpate.mesh.box_mesh import GridSpec

NUISANCE = tuple(range(15))
WEIGHT = 15


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield evaluator_of(SETUP, registration(), workers, [], None, GridSpec(), GridSpec())


def _model(evaluator: Evaluator, effects: tuple[Effect, ...], more: float) -> Model:
    """On data that ask for so much `more` of the first effect's number."""
    random = np.random.default_rng(4)
    columns = [random.standard_normal((6, 30, 16)) * np.r_[np.full(15, 1.0), 4.0] for _ in range(4)]
    blocks = linear_blocks(columns, NUISANCE, np.diag(np.full(15, 1e2)), {WEIGHT: more}, 5)
    own = tuple(range(WEIGHT, WEIGHT + sum(len(effect.numbers()) for effect in effects)))
    return Model(effects, SETUP, (), tuple(blocks), ModelColumns(tuple(NUISANCE), tuple(own)))


def test_weight_of_nothing_gains_nothing_by_being_less(evaluator):
    none, absent = (
        _model(evaluator, (), -0.5),
        _model(evaluator, (Gravity(specific_weight_over_stiffness=5e-4),), -0.5),
    )
    assert evaluator.score(absent).sum() == pytest.approx(evaluator.score(none).sum(), abs=1e-3)
    assert evaluator.misfit(absent) == pytest.approx(evaluator.misfit(none), rel=1e-5)


@pytest.mark.parametrize(("weight", "more"), [(5e-4, 0.5), (1.0, -0.5), (8.0, -0.5)])
def test_what_is_pulled_within_its_bounds_may_move(evaluator, weight, more):
    model = _model(evaluator, (Gravity(specific_weight_over_stiffness=weight),), more)
    assert np.array_equal(evaluator.bounded_precision(model), evaluator.precision(model))
    assert evaluator.score(model).sum() > evaluator.score(_model(evaluator, (), more)).sum() + 5


def test_upper_bound_holds_as_the_lower_does(evaluator):
    model = _model(evaluator, (Gravity(specific_weight_over_stiffness=7.9995),), 0.5)
    assert evaluator.score(model).sum() == pytest.approx(
        evaluator.score(_model(evaluator, (), 0.5)).sum(), abs=1e-3
    )
