from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from noisy_model import stated_evaluator
from pushed_block import CORNERS, SETUP, observed, poke, registration

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.mesh_discrepancy import too_coarse
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.search.candidates import candidates_of, mesh_candidates, tangents_of
from palpate.diagnosis.search.inclusion_grid import screened_inclusions
from palpate.diagnosis.search.initial_guess import initial_guess
from palpate.diagnosis.search.screening import Candidate, linear_gains, right_sides
from palpate.effects.geometry import DIAGNOSIS_GRID, MeshResolution
from palpate.mesh.box_mesh import GridSpec
from palpate.setup.setup import Setup

GRID, FINE, COARSE = (
    GridSpec(nodes=(9, 7, 6), spacing=2e-3),
    GridSpec(nodes=(11, 9, 7), spacing=1.7e-3),
    12e-3,
)
STATED = replace(SETUP, landmarks=CORNERS)
PLACES = {"poke-01": (4e-3, -2e-3), "poke-02": (-1.2e-2, 5e-3), "poke-03": (1.5e-2, 4e-3)}


def _screened(stated: Setup) -> tuple[Evaluator, Model, list[Candidate], dict[str, float]]:
    """What a block that behaves like GRID gives to screen: evaluator, baseline, candidates,
    and their gains by name.
    """
    data = []
    for seed, (name, (x, y)) in enumerate(PLACES.items()):
        centres = np.array([poke(-6e-3, x, y), poke(2e-3, x, y), poke(4e-3, x, y)])
        data.append(replace(observed(STATED, centres, noise=3e-4, seed=10 * seed), name=name))
    with Workers(data, 1) as workers:
        evaluator = evaluator_of(stated, registration(), workers, list(PLACES), None, GRID, FINE)
        problem = evaluator.problem
        inclusions = screened_inclusions(problem)
        baseline = evaluator.baseline(
            tangents_of(problem.applicable, stated), inclusions.lumps, (), inclusions.spots
        )
    finite = (
        [(DIAGNOSIS_GRID, list(evaluator.state.on_diagnosis_grid))]
        if evaluator.state.on_diagnosis_grid
        else []
    )
    model = evaluator.with_signatures(baseline, finite, baseline)
    candidates, blocks = candidates_of(model, evaluator, finite), evaluator.tempered(model)
    nuisance, known = (*model.nuisance, *model.columns), evaluator.precision(model)
    gains = linear_gains(blocks, right_sides(blocks), nuisance, known, candidates)[0]
    return (
        evaluator,
        model,
        candidates,
        {c.start.name: float(gain) for c, gain in zip(candidates, gains, strict=True)},
    )


def test_stated_grid_that_is_too_coarse_is_what_explains_the_data_best():
    evaluator, model, candidates, gains = _screened(replace(STATED, element_size=COARSE))
    assert gains["mesh_resolution"] > 25.0
    (own,) = [candidate for candidate in candidates if candidate.start.name == "mesh_resolution"]
    assert (
        initial_guess(own, model, evaluator) == DIAGNOSIS_GRID
        and DIAGNOSIS_GRID.apply(evaluator.problem.setup).element_size is None
    )


def test_grid_that_is_good_enough_is_not_named_and_costs_no_column():
    _, model, candidates, gains = _screened(STATED)
    assert gains["mesh_resolution"] < 5.0
    (own,) = [candidate for candidate in candidates if candidate.start.name == "mesh_resolution"]
    assert own.columns == () and own.widened == {model.nuisance[-1]: CRITERIA.priors.mesh_multiple}
    assert [one.of for one in candidates if one.start.name == "geometry_scale"] == [
        ("scale_x", "scale_y", "scale_z")
    ]


def test_candidate_of_the_own_grid_is_the_last_nuisance_with_a_wider_prior():
    model = Model((), SETUP, (), (), ModelColumns((0, 1, 2)))
    with stated_evaluator() as evaluator:
        (candidate,) = mesh_candidates(evaluator.problem, model)
    columns, precision = candidate.precision([0, 1, 2], np.eye(3))
    assert columns == [0, 1, 2] and precision[2, 2] == pytest.approx(
        1 / (1 + CRITERIA.priors.mesh_multiple**2)
    )
    assert candidate.start == MeshResolution.neutral(SETUP) and not candidate.refitted


def test_report_says_when_the_data_ask_for_a_finer_grid():
    assert too_coarse(20.0, 25.0) == ""
    assert "gains 80 nats, 25 are chance" in too_coarse(80.0, 25.0)
