from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import GRID, SETUP, observed, poke, registration

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.validation.falsified_motions import FALSIFIED
from palpate.diagnosis.validation.negative_controls import Control, controls, judge, warnings_of
from palpate.effects.tool import ToolRadius
from palpate.mesh.box_mesh import GridSpec

RADIUS = ToolRadius(radius=4e-3)
SEQUENCES, GROUPS, FIRST = 3, 6, TOOL_COLUMNS + 8
DEPTHS = [-2e-2, -2e-2, -2e-2, 3e-3, 5e-3, -2e-2, -2e-2]
PLACES = [(0.02, 3e-3), (-0.014, -6e-3)]


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """The stated setup with its priors; nothing is replayed here."""
    with Workers([], 1) as workers:
        yield evaluator_of(
            SETUP, registration(), workers, ["poke-01"], None, GridSpec(), GridSpec()
        )


def _judged(evaluator: Evaluator, true: float, false: float, alike: float = 0.0) -> Control:
    """Data that hold so much of a cause's pattern, and of another that falsified motions give it
    and that is partly like it.
    """
    random, shape = np.random.default_rng(1), (GROUPS, evaluator.problem.surface.patches)
    blocks = []
    for number in range(SEQUENCES):
        own, apart = 1e-4 * random.standard_normal((2, *shape))
        other = np.sqrt(alike) * own + np.sqrt(1 - alike) * apart
        columns = np.concatenate(
            [np.zeros((*shape, FIRST)), np.stack([own, other, np.zeros(shape)], axis=2)], axis=2
        )
        residual = 2e-4 * random.standard_normal(shape) - true * own - false * other
        blocks.append(Block(f"poke-{number:02d}", *gram(residual, columns, np.full(shape, 0.25e8))))
    return judge(evaluator, blocks, RADIUS, ("geometry mirrored",))[0]


def test_true_cause_loses_its_gain(evaluator):
    control = _judged(evaluator, 1.0, 0.0)
    assert control.true > 20 and control.gain < CRITERIA.controls.faint and control.passed
    assert control.to_json()["kept"] < 0.1 and warnings_of([control]) == []


def test_cause_that_falsified_motions_explain_as_well_does_not_pass(evaluator):
    control = _judged(evaluator, 1.0, 0.9)
    assert control.passed is False and control.to_json()["kept"] > 0.5
    (warning,) = warnings_of([control])
    assert "tool_radius" in warning and "geometry mirrored" in warning


def test_opposite_of_a_cause_gains_nothing(evaluator):
    control = _judged(evaluator, 1.0, -0.9)
    assert control.gain <= 0 and control.passed


def test_motions_that_look_the_same_say_nothing(evaluator):
    control = _judged(evaluator, 1.0, 0.0, alike=0.8)
    assert (
        control.alike > CRITERIA.controls.alike and control.passed is None and "80 %" in control.why
    )


def test_control_says_nothing_about_a_cause_without_gain(evaluator):
    control = _judged(evaluator, 0.0, 0.0)
    assert (
        control.passed is None and control.to_json()["kept"] is None and "too little" in control.why
    )


@pytest.fixture(scope="module")
def data() -> list[Observations]:
    """Two pokes of a tool that is smaller than stated, at two places."""
    truth = RADIUS.apply(SETUP)
    made = [
        observed(truth, np.array([poke(d, *place) for d in DEPTHS]), count=4000, noise=1e-4, seed=n)
        for n, place in enumerate(PLACES)
    ]
    return [replace(item, name=f"poke-{number:02d}") for number, item in enumerate(made)]


@pytest.mark.slow
def test_wrong_tool_radius_passes_every_control_on_replays(data):
    with Workers(data, 1) as workers:
        evaluator = evaluator_of(
            SETUP, registration(), workers, [item.name for item in data], None, GRID, GRID
        )
        baseline = evaluator.evaluate(())
        shape = baseline.predictions[0].gap.shape
        evaluator.state.noises = [
            Noise(
                np.where(np.isfinite(p.gap), p.count / 1e-8, 0.0),
                np.nan_to_num(p.gap),
                np.zeros(shape),
                np.zeros((*shape, 0)),
            )
            for p in baseline.predictions
        ]
        baseline, model = (
            evaluator.evaluate(()),
            evaluator.evaluate((RADIUS,), baseline.predictions),
        )
        found = controls(evaluator, data, model, baseline)
    assert [control.control for control in found] == list(FALSIFIED)
    assert all(
        control.true > 50 and control.gain < 0.3 * control.true and control.passed
        for control in found
    )
