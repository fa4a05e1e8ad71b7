"""What a fit's noise and the disagreement of sequences make of each parameter's interval."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from noisy_model import GROUPS, LUMP, NUISANCES, RADIUS, noisy_model, stated_evaluator
from pushed_block import SETUP, prediction

from palpate.diagnosis.inference.credible_intervals import (
    as_stated,
    intervals,
    is_supported_by_all_sequences,
    spread_of,
)
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, gram
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.noise.noise_model import Noise
from palpate.diagnosis.inference.parameter_blocks import ModelColumns
from palpate.effects.elastic_material import PoissonRatio
from palpate.effects.heterogeneity import Anisotropy
from palpate.effects.load import Gravity
from palpate.effects.sensor import CameraRegistration
from palpate.effects.support import BaseDetachment
from palpate.foundation.arrays import FloatArray

NU, CAMERA = (
    PoissonRatio(nu=0.40),
    CameraRegistration(tx=2e-3, ty=0.0, tz=-1e-3, rx=0.0, ry=0.02, rz=0.0),
)


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    with stated_evaluator() as found:
        yield found


@pytest.mark.parametrize(
    "effect",
    [LUMP, RADIUS, NU, CAMERA, Gravity(specific_weight_over_stiffness=1.2)],
    ids=lambda e: e.name,
)
def test_interval_holds_the_value_within_the_bounds(evaluator, effect):
    entry = intervals(evaluator, noisy_model(evaluator, effect))[0]
    assert set(entry) == set(effect.reported(evaluator.problem.setup))
    for item in effect.numbers():
        stated = entry[item.name]
        assert item.low <= stated["low"] < stated["value"] < stated["high"] <= item.high
        assert (
            stated["value"] == pytest.approx(getattr(effect, item.name))
            and stated["unit"] == item.unit
        )


def test_interval_of_a_direction_reaches_to_either_side_of_the_axis(evaluator):
    for direction in (0.0, 0.01, np.pi - 0.01):
        model = noisy_model(evaluator, Anisotropy(direction=direction, stiffness_ratio=3.0))
        assert model.ends[0] == 0
        stated = intervals(evaluator, model)[0]["direction"]
        assert stated["value"] == pytest.approx(direction)
        assert (
            stated["high"] - stated["value"] == pytest.approx(stated["value"] - stated["low"])
            and stated["low"] < stated["value"]
        )


def _measured_by(evaluator: Evaluator, sizes: FloatArray) -> Model:
    """A tool's radius that is off by these sizes [search scales] in as many sequences."""
    model, random = noisy_model(evaluator, RADIUS), np.random.default_rng(4)
    shape, column = (GROUPS, evaluator.problem.surface.patches), model.columns[0]
    blocks = []
    for number, size in enumerate(sizes):
        columns = np.zeros((*shape, NUISANCES + 1))
        columns[..., column] = 1e-5 / RADIUS.numbers()[0].scale * random.standard_normal(shape)
        gap = (
            1e-4 * random.standard_normal(shape)
            - size * RADIUS.numbers()[0].scale * columns[..., column]
        )
        blocks.append(Block(f"poke-{number:02d}", *gram(gap, columns, np.full(shape, 1e8))))
    return replace(model, blocks=tuple(blocks))


def test_interval_is_the_fits_deviation_where_sequences_agree(evaluator):
    model = _measured_by(evaluator, np.zeros(20))
    (radius,) = RADIUS.numbers()
    deviation = radius.scale / np.sqrt(0.1**2 * sum(block.values for block in model.blocks))
    entry = intervals(evaluator, model)[0]["radius"]
    assert (
        0.95
        < (entry["high"] - entry["low"]) / (2 * 1.96 * np.hypot(deviation, radius.accuracy))
        < 1.5
    )


def test_interval_holds_what_sequences_disagree_about(evaluator):
    sizes = np.array([-0.6, 0.5, 0.8, -0.7])
    entry = intervals(evaluator, _measured_by(evaluator, sizes))[0]["radius"]
    scale = RADIUS.numbers()[0].scale
    wanted = 3.18 * scale * sizes.std(ddof=1) / np.sqrt(len(sizes))
    assert (entry["high"] - entry["low"]) / 2 == pytest.approx(wanted, rel=0.2)


def _seen_by(evaluator: Evaluator, shares: FloatArray) -> tuple[Model, Model]:
    """A model with a lump, and the one without it: as many sequences, each of which sees this share
    of what the lump does.
    """
    random, shape = np.random.default_rng(4), (GROUPS, evaluator.problem.surface.patches)
    with_lump, without = [], []
    for number, share in enumerate(shares):
        does, columns = (
            1e-4 * random.standard_normal(shape),
            1e-4 * random.standard_normal((*shape, NUISANCES - 1)),
        )
        gap = share * does + 1e-4 * random.standard_normal(shape)
        without.append(prediction(gap, name=f"poke-{number:02d}", columns=columns))
        with_lump.append(prediction(gap - does, name=f"poke-{number:02d}", columns=columns))
    evaluator.state.noises = [
        Noise(np.full(shape, 1e8), one.gap, np.zeros(shape), np.zeros((*shape, 0)))
        for one in without
    ]
    nuisance = tuple(range(NUISANCES))
    return (
        Model((LUMP,), LUMP.apply(SETUP), tuple(with_lump), (), ModelColumns(nuisance)),
        Model((), SETUP, tuple(without), (), ModelColumns(nuisance)),
    )


def test_cause_stands_where_sequences_see_as_much_of_it(evaluator):
    assert is_supported_by_all_sequences(
        evaluator, *_seen_by(evaluator, np.array([1.0, 0.8, 1.1, 0.9]))
    )


@pytest.mark.parametrize(
    "shares",
    [[1.5, -1.5, 1.0, -1.0], [2.0, 0.0, 0.0, 0.1], [0.0, 0.0, 0.0, 0.0], [-1.0, -0.9, -1.1, -1.0]],
)
def test_cause_that_only_some_sequences_see_or_that_is_not_there_does_not_stand(evaluator, shares):
    assert not is_supported_by_all_sequences(evaluator, *_seen_by(evaluator, np.array(shares)))


def test_place_of_a_detached_edge_is_stated_without_interval(evaluator):
    entry = intervals(evaluator, noisy_model(evaluator, BaseDetachment(edge="+x", extent=0.02)))[0]
    assert entry["edge"] == {"value": "+x", "unit": ""}
    assert entry["extent"]["low"] < 0.02 < entry["extent"]["high"]


def test_camera_is_reported_by_its_magnitudes(evaluator):
    entry = intervals(evaluator, noisy_model(evaluator, CAMERA))[0]
    # In the phantom frame, whose origin lies under the block's middle: the turn moves it, too.
    assert entry["translation"]["value"] == pytest.approx(
        np.linalg.norm(CAMERA.shift(SETUP).translation)
    )
    assert abs(entry["translation"]["value"] - np.hypot(2e-3, 1e-3)) > 2e-4
    assert entry["rotation"]["value"] == pytest.approx(0.02)
    assert (
        entry["translation"]["low"] <= entry["translation"]["value"] <= entry["translation"]["high"]
    )


def test_magnitude_near_zero_lies_in_its_interval(evaluator):
    entry = intervals(
        evaluator, noisy_model(evaluator, CAMERA.moved([2e-3, 0.0, 0.0, 1e-6, 0.0, 0.0]))
    )[0]["rotation"]
    assert entry["low"] <= entry["value"] < entry["high"]


def test_intervals_of_several_causes_keep_to_their_columns(evaluator):
    lump, radius = intervals(evaluator, noisy_model(evaluator, LUMP, RADIUS))
    assert lump["stiffness_ratio"]["value"] == pytest.approx(4.0)
    assert radius["radius"]["value"] == pytest.approx(4.4e-3)


def test_effect_whose_numbers_may_be_as_stated_is_told(evaluator):
    """The radius is 5 mm as stated; half an interval's width away from it, and twice."""
    for half_widths, expected in ((0.5, ("tool_radius",)), (2.0, ())):
        near = noisy_model(evaluator, RADIUS)
        reach = 1.96 * float(spread_of(evaluator, near)[0])
        radius = SETUP.tool.radius + half_widths * reach
        model = replace(near, effects=(replace(RADIUS, radius=radius),))
        assert as_stated(evaluator, model) == expected


def test_every_number_must_be_as_stated(evaluator):
    model = noisy_model(evaluator, Gravity(specific_weight_over_stiffness=0.0), LUMP)
    assert as_stated(evaluator, model) == ("gravity",)
