"""What lies at a bound gains nothing by what lies beyond it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from linear_blocks import linear_blocks
from pushed_block import SETUP, registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.effects import Effect
from palpate.effects.load import Gravity
from palpate.mesh.box_mesh import GridSpec

NUISANCE = tuple(range(15))
WEIGHT = 15


@pytest.fixture(scope="module")
def bench() -> Iterator[Bench]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield Bench(SETUP, registration(), workers, [], None, GridSpec(), GridSpec())


def _model(bench: Bench, effects: tuple[Effect, ...], more: float) -> Model:
    """On data that ask for so much `more` of the first effect's number."""
    random = np.random.default_rng(4)
    columns = [random.standard_normal((6, 30, 16)) * np.r_[np.full(15, 1.0), 4.0] for _ in range(4)]
    blocks = linear_blocks(columns, NUISANCE, np.diag(np.full(15, 1e2)), {WEIGHT: more}, 5)
    own = tuple(range(WEIGHT, WEIGHT + sum(len(effect.numbers()) for effect in effects)))
    return Model(effects, SETUP, (), tuple(blocks), own, {}, NUISANCE)


def test_weight_of_nothing_gains_nothing_by_being_less(bench):
    none, absent = (
        _model(bench, (), -0.5),
        _model(bench, (Gravity(specific_weight_over_stiffness=5e-4),), -0.5),
    )
    assert bench.score(absent).sum() == pytest.approx(bench.score(none).sum(), abs=1e-3)
    assert bench.misfit(absent) == pytest.approx(bench.misfit(none), rel=1e-5)


@pytest.mark.parametrize(("weight", "more"), [(5e-4, 0.5), (1.0, -0.5), (8.0, -0.5)])
def test_what_is_pulled_within_its_bounds_may_move(bench, weight, more):
    model = _model(bench, (Gravity(specific_weight_over_stiffness=weight),), more)
    assert np.array_equal(bench.held(model), bench.precision(model))
    assert bench.score(model).sum() > bench.score(_model(bench, (), more)).sum() + 5


def test_upper_bound_holds_as_the_lower_does(bench):
    model = _model(bench, (Gravity(specific_weight_over_stiffness=7.9995),), 0.5)
    assert bench.score(model).sum() == pytest.approx(
        bench.score(_model(bench, (), 0.5)).sum(), abs=1e-3
    )
