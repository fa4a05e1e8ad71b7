from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import SETUP, prediction, registration

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.search.screening import Candidate
from palpate.diagnosis.search.shortlist import beyond_first_order, shortlist
from palpate.effects.elastic_material import PoissonRatio, StiffInclusion
from palpate.effects.load import Gravity
from palpate.effects.sensor import CameraRegistration, TimeOffset
from palpate.effects.support import BaseSlip
from palpate.effects.tool import ToolOffset, ToolRadius
from palpate.mesh.box_mesh import GridSpec

NUISANCES, GROUPS = TOOL_COLUMNS + 9, 4
OFFSET = Candidate(start=ToolOffset.neutral(SETUP), widened={0: 2e-3, 1: 2e-3, 2: 2e-3})
RADIUS = Candidate(start=ToolRadius.neutral(SETUP), widened={TOOL_COLUMNS: 1e-3})
NU = Candidate(start=PoissonRatio.neutral(SETUP), widened={TOOL_COLUMNS + 1: 0.1})
CAMERA = Candidate(start=CameraRegistration.neutral(SETUP), widened={TOOL_COLUMNS + 2: 1e-3})
CLOCK = Candidate(start=TimeOffset.neutral(SETUP), columns=(NUISANCES,), spread=(0.2,))
SAG = Candidate(
    start=Gravity(specific_weight_over_stiffness=1.5), columns=(NUISANCES,), spread=(1.0,)
)
SLIDING = Candidate(start=BaseSlip(friction_coefficient=0.2), columns=(NUISANCES,), spread=(1.0,))


def lump(x: float, y: float = 0.0) -> Candidate:
    return Candidate(
        start=StiffInclusion(x=x, y=y, z=0.02, radius=7e-3, stiffness_ratio=1.0),
        columns=(NUISANCES,),
        spread=(2.0,),
    )


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield evaluator_of(
            SETUP, registration(), workers, ["poke-01"], None, GridSpec(), GridSpec()
        )


def _pulled(evaluator: Evaluator, pulls: dict[int, float]) -> Model:
    """Data that know every nuisance well, and pull some of them this many of its stated deviations
    away.
    """
    deviations = np.sqrt(np.diag(np.linalg.inv(evaluator.problem.nuisances.precision)))
    shape = (GROUPS, evaluator.problem.surface.patches)
    columns = 1e-3 / deviations * np.random.default_rng(0).standard_normal((*shape, NUISANCES))
    size = np.zeros(NUISANCES)
    for column, pull in pulls.items():
        size[column] = pull * deviations[column]
    gap = -(columns @ size)
    block = Block("poke-01", *gram(gap, columns, np.full(shape, 1e8)))
    return Model((), SETUP, (prediction(gap),), (block,), ModelColumns(tuple(range(NUISANCES))))


def test_tools_offset_and_radius_are_always_refitted(evaluator):
    assert beyond_first_order(
        evaluator, _pulled(evaluator, {}), [SAG, RADIUS, OFFSET, NU, CLOCK]
    ) == [RADIUS, OFFSET]


def test_the_worst_of_the_accuracies_that_the_data_break_is_refitted_too(evaluator):
    model = _pulled(evaluator, {TOOL_COLUMNS + 2: 6.0, TOOL_COLUMNS + 1: 20.0})
    assert beyond_first_order(evaluator, model, [OFFSET, CAMERA, NU]) == [OFFSET, NU]


def test_what_lies_within_the_stated_accuracy_is_not_refitted_for_it(evaluator):
    model = _pulled(evaluator, {0: 2.0, TOOL_COLUMNS + 2: 3.0, TOOL_COLUMNS + 1: -2.5})
    assert beyond_first_order(evaluator, model, [SAG, CAMERA, NU, CLOCK]) == []


def test_settled_one_comes_first_and_takes_nobodys_place():
    candidates = [SAG, CLOCK, SLIDING, NU, RADIUS]
    gains = np.array([30.0, 50.0, 40.0, 20.0, -3.0])
    assert (
        shortlist(gains, candidates, 10.0) == [CLOCK, SLIDING, SAG][: CRITERIA.screening.shortlist]
    )
    assert shortlist(gains, candidates, 10.0, [RADIUS]) == [RADIUS, CLOCK, SLIDING, SAG]
    assert shortlist(gains, candidates, 10.0, [CLOCK]) == [CLOCK, SLIDING, SAG, NU]


def test_only_what_promises_enough_is_fitted():
    assert shortlist(np.array([9.0, 11.0, 2.0]), [SAG, CLOCK, NU], 10.0) == [CLOCK]


def test_lump_begins_at_two_places_well_apart():
    candidates = [lump(0.0), lump(0.004), lump(0.02), lump(-0.02), CLOCK]
    gains = np.array([60.0, 55.0, 50.0, 45.0, 30.0])
    assert shortlist(gains, candidates, 10.0) == [candidates[0], candidates[2], CLOCK]
