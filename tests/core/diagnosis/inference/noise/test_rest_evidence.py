from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import CORNERS, GRID, SETUP

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block, fit
from palpate.diagnosis.inference.noise.rest_evidence import touch_block
from palpate.effects import Effect
from palpate.effects.geometry import GeometryScale
from palpate.effects.tool import LandmarkMismatch
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.touch_correction import touched_places
from palpate.registration.robot.robot_fit import fit_robot
from palpate.setup.setup import Setup, Touching

STATED = replace(SETUP, landmarks=CORNERS, touching=Touching(lift=5e-3))
POSE = Transform.from_vector([0.1, -0.2, 0.3], [0.4, -1.1, 0.7])
NONE = np.array([[1e-9]])


def _registered(
    truth: Setup, noise: float = 0.0, seed: int = 0, moved: Transform | None = None
) -> Setup:
    """The stated setup with the touches that were made as in `truth`, by a robot that was then
    `moved`.
    """
    lift = np.array([0.0, 0.0, truth.touching.lift])
    error: FloatArray = noise * np.random.default_rng(seed).standard_normal(
        (len(truth.landmarks), 3)
    )
    made = (moved or Transform()).apply(POSE.inverse().apply(touched_places(truth) + lift + error))
    fitted = fit_robot(made, np.array(truth.landmarks) + lift)
    misses = tuple((float(x), float(y), float(z)) for x, y, z in fitted.residuals)
    return replace(
        STATED,
        phantom_from_robot=fitted.phantom_from_robot,
        touching=replace(STATED.touching, misses=misses),
    )


def _block(setup: Setup, effect: Effect | None = None, name: str = "", step: float = 1e-5) -> Block:
    if effect is None:
        return touch_block(setup, GRID, 1, {})
    here = effect.apply(setup)
    near = replace(effect, **{name: getattr(effect, name) + step}).apply(setup)
    return touch_block(here, GRID, 1, {0: (near, step)})


def test_right_touches_cost_what_their_noise_does():
    costs = [
        _block(_registered(STATED, CRITERIA.rest.touch_deviation, seed)).gram[0, 0]
        for seed in range(200)
    ]
    assert np.mean(costs) == pytest.approx(_block(STATED).values, rel=0.15)
    assert _block(STATED).values == 3 * 4 - 6


def test_a_robot_registered_anywhere_costs_nothing():
    moved = Transform.from_vector([0.02, 0.01, -0.03], [0.1, 0.2, -0.3])
    here, there = (_block(_registered(STATED, 3e-4, 1, one)) for one in (Transform(), moved))
    assert there.gram[0, 0] == pytest.approx(here.gram[0, 0])


@pytest.mark.parametrize(
    ("truth", "name"),
    [
        (LandmarkMismatch(pairing="as-paired", scale=0.94, inset=0.0), "scale"),
        (LandmarkMismatch(pairing="as-paired", scale=1.0, inset=2e-3), "inset"),
        (GeometryScale(scale_x=1.04, scale_y=1.0, scale_z=1.0), "scale_x"),
    ],
)
def test_misses_tell_how_far_off_the_places_were(truth: Effect, name: str):
    setup = _registered(truth.apply(STATED))
    neutral = truth.neutral(STATED)
    stated = _block(setup, neutral, name)
    assert stated.gram[0, 0] > 30
    assert _block(setup, truth, name).gram[0, 0] < 1e-6
    assert fit([stated], [0], NONE).change[0] == pytest.approx(
        getattr(truth, name) - getattr(neutral, name), rel=0.02
    )


def test_height_of_the_phantom_shows_in_no_touch_of_its_top():
    effect, setup = GeometryScale(scale_x=1.0, scale_y=1.0, scale_z=1.0), _registered(STATED)
    wide, high = (_block(setup, effect, name).gram[1, 1] for name in ("scale_x", "scale_z"))
    assert high < 1e-6 * wide


def test_swapped_corners_cost_far_more_than_any_cause_gains():
    truth = LandmarkMismatch(pairing="swap-1-2", scale=1.0, inset=0.0)
    setup = _registered(truth.apply(STATED))
    assert _block(setup).gram[0, 0] > 2000
    assert _block(setup, truth, "scale").gram[0, 0] < 1e-6


def test_two_touches_say_nothing():
    lonely = replace(STATED, landmarks=CORNERS[:2])
    assert (
        not touch_block(lonely, GRID, 2, {}).gram.any()
        and touch_block(lonely, GRID, 2, {}).values == 0
    )


def test_stated_deviation_replaces_the_usual_one():
    setup = _registered(STATED, 2e-4, seed=3)
    exact = replace(setup, touching=replace(setup.touching, deviation=2e-4))
    ratio = _block(exact).gram[0, 0] / _block(setup).gram[0, 0]
    assert ratio == pytest.approx((CRITERIA.rest.touch_deviation / 2e-4) ** 2)
