"""Fits of hypotheses with history."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from dragged_block import dragged
from evaluating import evaluator_of
from pushed_block import GRID, SETUP, registration

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.gain.surface_gain import surface_gain
from palpate.diagnosis.inference.credible_intervals import intervals
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.final_fit import settle
from palpate.diagnosis.inference.gauss_newton import refit
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.trials import HeldHistory
from palpate.diagnosis.validation.falsified_motions import FALSIFIED
from palpate.diagnosis.validation.negative_controls import controls
from palpate.effects import Effect
from palpate.effects.base import with_effects
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity
from palpate.effects.tool import ToolFriction, ToolOffset, ToolRadius
from palpate.foundation.arrays import FloatArray

TRUE: dict[str, Effect] = {
    "viscoelasticity": Viscoelasticity(relaxed_fraction=0.6, time_constant=1.2),
    "permanent_set": PermanentSet(retained_fraction=0.25),
    "tool_friction": ToolFriction(friction_coefficient=0.35),
}
BEGIN: dict[str, Effect] = {
    "viscoelasticity": Viscoelasticity(relaxed_fraction=0.5, time_constant=0.3),
    "permanent_set": PermanentSet(retained_fraction=0.15),
    "tool_friction": ToolFriction(friction_coefficient=0.5),
}


@pytest.fixture(scope="module", params=TRUE)
def name(request: pytest.FixtureRequest) -> str:
    return request.param


@pytest.fixture(scope="module")
def data(name: str) -> list[Observations]:
    """Two drags, there and back, of a block in which one thing is remembered."""
    truth = TRUE[name].apply(SETUP)
    return [
        dragged(truth, 1e-4, f"drag-{number:02d}", turn) for number, turn in enumerate((1.0, -1.0))
    ]


@pytest.fixture(scope="module")
def evaluator(data: list[Observations]) -> Iterator[Evaluator]:
    with Workers(data, 1) as workers:
        made = evaluator_of(
            SETUP, registration(), workers, [item.name for item in data], None, GRID, GRID
        )
        shape = made.evaluate(()).predictions[0].gap.shape
        made.state.noises = [_noise(item, shape) for item in made.evaluate(()).predictions]
        yield made


def _noise(item: Prediction, shape: tuple[int, ...]) -> Noise:
    weights = np.where(np.isfinite(item.gap), item.count / 1e-8, 0.0)
    return Noise(weights, np.nan_to_num(item.gap), np.zeros(shape), np.zeros((*shape, 0)))


def _change(there: list[Prediction], here: list[Prediction]) -> FloatArray:
    return np.concatenate(
        [one.change_from(other)[0].ravel() for one, other in zip(there, here, strict=True)]
    )


def test_columns_are_nearly_what_another_size_changes(evaluator, name):
    baseline, effect = evaluator.evaluate(()), BEGIN[name]
    model = evaluator.evaluate((effect,), baseline.predictions)
    for number, (item, column) in enumerate(zip(effect.numbers(), model.columns, strict=True)):
        coordinates = effect.coordinates
        coordinates[number] += item.scale
        there = [
            f.result()
            for f in evaluator.predict([effect.at(coordinates)], None, baseline.predictions)
        ]
        true = _change(there, list(model.predictions)) / item.scale
        stated = np.concatenate([one.columns[..., column].ravel() for one in model.predictions])
        assert true @ stated / np.linalg.norm(true) / np.linalg.norm(stated) > 0.85


def test_columns_of_what_is_not_remembered_stay_in_their_places(evaluator, name):
    radius, baseline = ToolRadius(radius=4.6e-3), evaluator.evaluate(())
    both, alone = (
        evaluator.evaluate((BEGIN[name], radius), baseline.predictions),
        evaluator.evaluate((radius,), baseline.predictions),
    )
    own, place = (model.predictions[0].columns[..., model.columns[-1]] for model in (both, alone))
    assert len(both.columns) == 1 + len(BEGIN[name].numbers())
    assert np.array_equal(own, place) and np.abs(own).max() > 0.1


def test_change_by_a_history_that_is_held_is_nearly_that_of_a_full_replay(evaluator, name):
    """A cause beside it that shifts the tool by 0.3 mm; and a size that differs, to first order."""
    baseline = evaluator.evaluate(())
    beside = evaluator.evaluate((BEGIN[name],), baseline.predictions)
    held, offset = HeldHistory(evaluator, beside), ToolOffset(dx=0.0, dy=0.0, dz=-3e-4)
    same = held.evaluate((BEGIN[name],), held.plain.predictions)
    assert np.abs(_change(list(same.predictions), list(beside.predictions))).max() < 3e-5
    effects = (BEGIN[name], offset)
    quick = held.evaluate(effects, held.plain.predictions)
    full = evaluator.evaluate(effects, beside.predictions)
    assert quick.layout == full.layout
    true, found = (
        _change(list(model.predictions), list(beside.predictions)) for model in (full, quick)
    )
    assert np.linalg.norm(found - true) < 0.6 * np.linalg.norm(true)
    coordinates = BEGIN[name].coordinates
    coordinates[0] += 0.2 * BEGIN[name].numbers()[0].scale
    moved = held.evaluate((BEGIN[name].at(coordinates),), held.plain.predictions)
    step = _change(list(moved.predictions), list(beside.predictions))
    column = np.concatenate(
        [one.columns[..., beside.columns[0]].ravel() for one in beside.predictions]
    )
    wanted = 0.2 * BEGIN[name].numbers()[0].scale * column
    assert np.abs(step - wanted).max() < 3e-5


def test_fit_finds_what_is_remembered_and_its_gain_and_controls_know_it(evaluator, data, name):
    baseline = evaluator.evaluate(())
    model = refit(evaluator, [BEGIN[name]], baseline.predictions)
    for item, value, true in zip(
        model.effects[0].numbers(),
        model.effects[0].coordinates,
        TRUE[name].coordinates,
        strict=True,
    ):
        assert value == pytest.approx(true, abs=0.6 * item.scale)
    (entry,) = intervals(evaluator, model)
    assert all(one["low"] < one["value"] < one["high"] for one in entry.values())
    gain = surface_gain(data, baseline.predictions, model.predictions, SETUP, model.setup, 0)
    assert gain.removed[0] > 0.8
    found = controls(evaluator, data, model, baseline)
    assert [control.control for control in found] == list(FALSIFIED)
    assert all(control.true > 30 and control.passed is not False for control in found)


def test_a_fit_beside_a_history_ends_at_the_truth_by_replayed_columns() -> None:
    """Viscoelasticity and a tool that is off by 1 mm, from a third short of either."""
    true = (TRUE["viscoelasticity"], ToolOffset(dx=-8e-4, dy=0.0, dz=6e-4))
    looks = [
        dragged(with_effects(SETUP, true), 1e-4, f"drag-{number:02d}", turn)
        for number, turn in enumerate((1.0, -1.0))
    ]
    begin = (
        Viscoelasticity(relaxed_fraction=0.4, time_constant=0.8),
        ToolOffset(dx=0.0, dy=0.0, dz=4e-4),
    )
    with Workers(looks, 1) as workers:
        names = [item.name for item in looks]
        evaluator = evaluator_of(SETUP, registration(), workers, names, None, GRID, GRID)
        plain = evaluator.evaluate(()).predictions
        evaluator.state.noises = [_noise(item, item.gap.shape) for item in plain]
        start = evaluator.evaluate(begin, plain)
        model = settle(evaluator, start, evaluator.problem.nuisances.precision, 0.5)
        other = evaluator.evaluate(true, plain)
    assert evaluator.objective(model) > evaluator.objective(other) - 3
    for item, value, wanted in zip(
        model.parameters, model.coordinates, other.coordinates, strict=True
    ):
        assert value == pytest.approx(wanted, abs=0.3 * item.scale)
