from __future__ import annotations

import numpy as np
import pytest
from dragged_block import dragged
from pushed_block import GRID, SETUP

from palpate.diagnosis.forward.history_columns import traces_of
from palpate.diagnosis.forward.loading_history import loading_history_of
from palpate.diagnosis.forward.prediction import Prediction, predict
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.effects import Effect
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity
from palpate.effects.tool import ToolFriction
from palpate.foundation.frames import Transform

EFFECTS: dict[str, Effect] = {
    "soon": Viscoelasticity(relaxed_fraction=0.5, time_constant=0.3),
    "late": Viscoelasticity(relaxed_fraction=0.5, time_constant=3.0),
    "set": PermanentSet(retained_fraction=0.2),
    "slips": ToolFriction(friction_coefficient=0.15),
    "sticks": ToolFriction(friction_coefficient=0.5),
}


@pytest.fixture(scope="module")
def data() -> Observations:
    return dragged()


@pytest.fixture(scope="module")
def plain(data: Observations) -> Prediction:
    return predict(data, SETUP, GRID)


@pytest.mark.parametrize("name", EFFECTS)
def test_trace_is_nearly_what_a_replay_along_the_whole_way_changes(data, plain, name):
    effect = EFFECTS[name]
    (trace,) = traces_of(data, SETUP, GRID, plain.equilibria, plain.samples, [effect])
    led = predict(data, effect.apply(SETUP), GRID, samples=plain.samples)
    true, weights = np.nan_to_num(led.gap - plain.gap), plain.count
    shared, own, other = (
        float(np.sum(weights * a * b))
        for a, b in ((true, trace.gap), (trace.gap, trace.gap), (true, true))
    )
    assert shared / np.sqrt(own * other) > 0.93
    assert shared / own == pytest.approx(1.0, abs=0.35)
    assert np.abs(trace.gap[:2]).max() == 0.0  # nothing was touched yet
    if isinstance(effect, ToolFriction):
        assert np.abs(trace.gap[7:]).max() == 0.0  # and friction leaves nothing
    else:
        assert np.abs(trace.gap[9]).max() > 2e-6


def test_several_effects_at_once_are_as_each_alone(data, plain):
    both = traces_of(
        data, SETUP, GRID, plain.equilibria, plain.samples, [EFFECTS["set"], EFFECTS["sticks"]]
    )
    for name, trace in zip(("set", "sticks"), both, strict=True):
        (alone,) = traces_of(data, SETUP, GRID, plain.equilibria, plain.samples, [EFFECTS[name]])
        assert np.array_equal(trace.gap, alone.gap) and np.array_equal(trace.force, alone.force)


def test_force_of_a_trace_is_that_of_the_replay(data, plain):
    effects = [EFFECTS["slips"], EFFECTS["late"]]
    traces = traces_of(data, SETUP, GRID, plain.equilibria, plain.samples, effects)
    for effect, trace in zip(effects, traces, strict=True):
        led = predict(data, effect.apply(SETUP), GRID, samples=plain.samples)
        change = np.array(
            [
                there.force - here.force
                for there, here in zip(led.equilibria, plain.equilibria, strict=True)
            ]
        )
        held = slice(4, 7)
        assert -trace.force[held] == pytest.approx(
            change[held], abs=0.25 * float(np.abs(change[held]).max())
        )


def test_what_was_between_two_looks_goes_with_the_depth(data, plain):
    time = loading_history_of(data, SETUP, Transform(), plain.equilibria)
    assert time.touched == (2, 3, 4, 5, 6)
    inside = (time.times > 1.2) & (time.times < 2.0)
    assert time.shares[inside].sum(axis=1) == pytest.approx(1.0, abs=0.02)
    early = np.argmin(np.abs(time.times - 0.8))
    assert time.shares[early, 0] == pytest.approx(time.depths[early] / 2.5e-3, rel=0.05)
    assert not time.shares[time.times < 0.7].any() and not time.shares[time.times > 2.5].any()


def test_memory_follows_what_is_held_and_fades_when_it_is_gone(data, plain):
    time = loading_history_of(data, SETUP, Transform(), plain.equilibria)
    left = time.faded(np.full(len(time.times), 1 / 0.5)).sum(axis=1)
    assert left[:2] == pytest.approx(0.0) and left[6] > 0.85 > left[4]
    assert left[9] / left[8] == pytest.approx(np.exp(-1.5 / 0.5), rel=0.05)
