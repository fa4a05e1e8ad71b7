from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import EYE, GRID, SETUP, TOP, prediction, registration

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.design.candidate_pushes import Push, pushes
from palpate.diagnosis.design.next_probe import (
    Pair,
    _advice,
    _choices,
    _other_measurements,
    pairs_of,
)
from palpate.diagnosis.design.predictive_distance import Scene, Survivor, _divergence, nats_of
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.residual_structure import Structure
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.search.identifiability import Identifiability, Limit
from palpate.diagnosis.search.screening import Candidate
from palpate.effects import CATALOGUE, Effect
from palpate.effects.base import with_effects
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.sensor import TimeOffset
from palpate.effects.tool import ToolRadius
from palpate.mesh.box_mesh import GridSpec

NOTHING = Survivor(SETUP)
LUMP = Survivor(
    StiffInclusion(x=0.02, y=0.0, z=0.026, radius=7e-3, stiffness_ratio=8.0).apply(SETUP)
)
LATE = Survivor(TimeOffset(offset=0.1).apply(SETUP))
DEEP = Push(kind="top", side="top", into=(0.0, 0.0, -1.0), place=(0.02, 0.0, TOP), depth=5e-3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A camera that sees the top and two sides, six points to a patch with 0.3 mm of noise;
    nuisances known exactly.
    """
    surface = SETUP.surface()
    seen = (surface.patch_normals @ [-0.6, -0.5, 0.6]) > 0
    return Scene(
        stated=NOTHING,
        lumps=(),
        centres=surface.patch_centres,
        normals=surface.patch_normals,
        count=np.where(seen, 6.0, 0.0),
        variance=np.full(surface.patches, 9e-8),
        eye=EYE,
        pivot=np.array([0.0, 0.0, TOP]),
        grid=GRID,
        temperature=1.0,
    )


def _nats(scene: Scene, push: Push, other: Survivor = LUMP) -> tuple[float, float]:
    return nats_of(scene, [(NOTHING, other)], push)[0]


def test_divergence_is_that_of_two_gaussians_with_one_covariance():
    random = np.random.default_rng(0)
    difference, blur, weights = (
        random.standard_normal(9),
        random.standard_normal((9, 3)),
        random.uniform(0.5, 2.0, 9),
    )
    covariance = np.diag(1 / weights) + blur @ blur.T
    parts = [(difference[:4], blur[:4], weights[:4]), (difference[4:], blur[4:], weights[4:])]
    assert _divergence(parts) == pytest.approx(
        0.5 * difference @ np.linalg.solve(covariance, difference)
    )


def test_lump_is_told_where_it_lies_and_not_at_the_other_end(scene):
    near, far = _nats(scene, DEEP)[1], _nats(scene, replace(DEEP, place=(-0.02, 0.0, TOP)))[1]
    assert near > 20 * far > 0


def test_deeper_push_tells_more(scene):
    half, full = _nats(scene, DEEP)
    assert half < full and _nats(scene, DEEP.half())[1] < full


def test_models_that_are_the_same_are_not_told_apart(scene):
    assert _nats(scene, DEEP, NOTHING) == (0.0, 0.0)


def test_temperature_and_noise_divide_the_nats(scene):
    nats = _nats(scene, DEEP)[1]
    assert _nats(replace(scene, temperature=2.0), DEEP)[1] == pytest.approx(nats / 2)
    assert _nats(replace(scene, variance=4 * scene.variance), DEEP)[1] < nats


def test_what_is_open_in_the_nuisances_blurs(scene):
    other = Survivor(ToolRadius(radius=5.4e-3).apply(SETUP))
    open_tool = replace(NOTHING, covariance=np.diag([3e-4] * 3 + [1e-4] * 3 + [1e-4, 0.01]) ** 2)
    known = _nats(scene, DEEP, other)[1]
    assert 0 < nats_of(scene, [(open_tool, other)], DEEP)[0][1] < 0.7 * known


def test_clock_shows_only_in_passing(scene):
    assert _nats(scene, DEEP, LATE)[1] == pytest.approx(0.0, abs=1e-9)
    assert _nats(scene, replace(DEEP, speed=0.02), LATE)[1] > 1.0


def test_chance_is_even_where_the_bound_is_expected_and_certain_far_beyond():
    pair = Pair((NOTHING, LUMP), ("none", "stiff_inclusion"), (8.0, 8.0))
    assert pair.chance(8.0) == pytest.approx(0.5)
    assert pair.chance(0.0) < 1e-6 and pair.chance(60.0) > 0.99
    assert replace(pair, needed=(2.0, 14.0)).chance(8.0) == pytest.approx(0.5)


def test_best_push_is_the_one_over_the_lump(scene):
    pair = Pair((NOTHING, LUMP), ("none", "stiff_inclusion"), (25.0, 25.0))
    tried = pushes(SETUP, 5e-3, drags=False)[:18]
    found = [_advice(push, [pair], nats_of(scene, [pair.models], push)) for push in tried]
    best = _choices(sorted(found, key=lambda one: -one.chances))
    assert (
        best[0].push.side == "top"
        and np.linalg.norm(np.subtract(best[0].push.place[:2], (0.02, 0.0))) < 0.011
    )
    row = best[0].to_json()
    assert row["separates"] == ["none", "stiff_inclusion"] and row["direction"] == [0.0, 0.0, -1.0]
    assert row["nats"] > 0 and 0 <= row["probability"] <= 1 and row["text"].startswith("press")
    assert len({one.push.side for one in best}) == len(best) > 1 and best[0].nats >= best[1].nats


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield evaluator_of(
            SETUP, registration(), workers, ["poke-01"], None, GridSpec(), GridSpec()
        )


def _trial(evaluator: Evaluator, gain: float, *effects: Effect) -> Trial:
    """A refit whose data know nothing but noise."""
    own = sum(len(effect.numbers()) for effect in effects)
    first, shape = TOOL_COLUMNS + 8, (4, evaluator.problem.surface.patches)
    columns = 1e-5 * np.random.default_rng(0).standard_normal((*shape, first + own + 1))
    gap = np.zeros(shape)
    block = Block("poke-01", *gram(gap, columns, np.full(shape, 1e8)))
    nuisance = (*range(first), first + own)
    model = Model(
        effects,
        with_effects(SETUP, effects),
        (prediction(gap),),
        (block,),
        ModelColumns(nuisance, tuple(range(first, first + own))),
    )
    return Trial(model, gain, 1.0)


def _findings(evaluator: Evaluator, *trials: Trial) -> Findings:
    return Findings(_trial(evaluator, 0.0).model, trials[0] if trials else None, list(trials))


RADIUS = ToolRadius(radius=4.2e-3)
HARD = StiffInclusion(x=0.0, y=0.0, z=0.02, radius=7e-3, stiffness_ratio=4.0)


def test_rivals_are_told_apart_and_the_best_needs_less_to_win(evaluator):
    trials = [
        _trial(evaluator, 90.0, RADIUS),
        _trial(evaluator, 85.0, HARD),
        _trial(evaluator, 20.0, TimeOffset(offset=0.1)),
    ]
    (pair,) = pairs_of(evaluator, _findings(evaluator, *trials))
    assert pair.names == ("tool_radius", "stiff_inclusion") and pair.needed == (
        CRITERIA.naming.rival - 5,
        CRITERIA.naming.rival + 5,
    )
    known, open_numbers = pair.models[0].covariance, pair.models[1].varied
    assert known is not None and known.shape == (9, 9) and len(open_numbers) == 5


def test_cause_found_alone_is_weighed_against_what_came_next_or_against_nothing(evaluator):
    trials = [_trial(evaluator, 90.0, RADIUS), _trial(evaluator, 20.0, HARD)]
    assert [pair.names for pair in pairs_of(evaluator, _findings(evaluator, *trials))] == [
        ("tool_radius", "stiff_inclusion")
    ]
    assert [pair.names for pair in pairs_of(evaluator, _findings(evaluator, trials[0]))] == [
        ("tool_radius", "none")
    ]


def test_where_nothing_was_found_what_hides_best_is_asked_for_at_its_limit(evaluator):
    findings, neutral = _findings(evaluator), replace(HARD, stiffness_ratio=1.0)
    faint = Limit(item=RADIUS.numbers()[0], size=4e-4)
    clear = Limit(item=HARD.numbers()[4], size=0.08)
    findings.identifiability = (
        Identifiability(
            Candidate(start=neutral, of=("stiffness_ratio",), columns=(15,), spread=(2.0,)),
            (clear,),
            clear,
        ),
        Identifiability(
            Candidate(start=ToolRadius(radius=5e-3), of=("radius",), widened={6: 1.2e-3}),
            (faint,),
            faint,
        ),
    )
    first, second = pairs_of(evaluator, findings)
    assert first.names == ("none", "tool_radius") and first.models[
        1
    ].setup.tool.radius == pytest.approx(5.4e-3)
    assert second.models[1].setup.material.inclusions[0].stiffness_ratio == pytest.approx(
        HARD.numbers()[4].value(0.08)
    )
    findings.structure = Structure(50.0, 20.0, 30.0)
    assert pairs_of(evaluator, findings) == []


def test_families_that_no_push_tells_apart_get_another_measurement(evaluator):
    rest = Pair(
        (NOTHING, NOTHING),
        ("viscoelasticity + tool_radius", "permanent_set + tool_radius"),
        (8.0, 8.0),
    )
    (row,) = _other_measurements(
        CATALOGUE, [rest, Pair((NOTHING, LUMP), ("none", "stiff_inclusion"), (8.0, 8.0))]
    )
    assert "several time constants" in row["text"] and row["kind"] == "measurement"
