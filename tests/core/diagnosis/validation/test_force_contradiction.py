"""Forces that a constant explains better than a model does contradict every verdict."""

from __future__ import annotations

import numpy as np
import pytest
from pushed_block import SETUP

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.diagnosis.observation.force_record import ForceComparison
from palpate.diagnosis.report.report import verdict_of
from palpate.diagnosis.search.findings import Findings, Trial
from palpate.diagnosis.validation.force_contradiction import constant_share, force_contradiction
from palpate.effects.elastic_material import YoungModulus
from palpate.foundation.arrays import FloatArray

DEPTHS = np.array([0.0, 1.0, 2.0, 3.0, 0.0, 2.0, 4.0, 0.0]) * 1e-3
PUSH = np.outer(DEPTHS**1.5, [0.1, 0.0, 1.0]) * 600.0
NOISE = 2e-3 * np.random.default_rng(1).normal(size=PUSH.shape)


def _model(measured: FloatArray, simulated: FloatArray) -> Model:
    forces = ForceComparison(
        measured - simulated,
        np.full(len(measured), 2e-3),
        simulated,
        np.zeros((len(measured), 3, 0)),
    )
    none = np.zeros((len(measured), 0))
    prediction = Prediction(
        "poke", none, none, none, np.zeros((len(measured), 0, 0)), (), (), forces
    )
    cause = YoungModulus(E=320.0)
    return Model((cause,), SETUP, (prediction,), (), ModelColumns(()))


@pytest.mark.parametrize("factor", [1.0, 0.4, 7.0])
def test_forces_of_the_pushes_contradict_nothing_whatever_their_size(factor: float) -> None:
    model = _model(factor * PUSH + NOISE, PUSH)
    assert force_contradiction(model, model) == ""


@pytest.mark.parametrize(
    "measured",
    [-PUSH + NOISE, np.zeros_like(PUSH), NOISE, np.roll(PUSH, 2, axis=0)[::-1] * [-1, 1, -1]],
    ids=["reversed", "dead", "noise", "others"],
)
def test_other_forces_contradict_a_cause_and_leave_no_verdict(measured: FloatArray) -> None:
    model = _model(measured, PUSH)
    why = force_contradiction(model, model)
    assert "young_modulus leaves" in why and "less than 1 is expected" in why
    findings = Findings(model, best=Trial(model, 900.0, 1.0))
    assert verdict_of(findings) == "found"
    findings.contradict(why)
    assert verdict_of(findings) == "unexplained" and findings.withdrawn == why


def test_pushes_too_light_to_feel_contradict_nothing() -> None:
    model = _model(NOISE, 1e-3 * PUSH)
    assert force_contradiction(model, model) == ""


def test_share_is_that_of_the_best_positive_scale() -> None:
    assert constant_share(2.0 * PUSH, PUSH) == pytest.approx(0.0, abs=1e-12)
    whole = (PUSH**2).sum() / ((PUSH - PUSH.mean(axis=0)) ** 2).sum()
    assert constant_share(-PUSH, PUSH) == pytest.approx(whole)
