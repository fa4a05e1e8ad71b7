from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import EYE, GRID, SETUP, TOP

from core.diagnosis.blurring import Scene, Survivor, _divergence, nats_of
from core.diagnosis.next_probe import Pair, _advice, _choices
from core.diagnosis.pushes import Push, pushes
from core.effects.material import StiffInclusion
from core.effects.sensor import TimeOffset
from core.effects.tool import ToolRadius
from core.measurement import Surface

NOTHING = Survivor(SETUP)
LUMP = Survivor(StiffInclusion(x=0.02, y=0.0, z=0.026, radius=7e-3, stiffness_ratio=8.0).apply(SETUP))
LATE = Survivor(TimeOffset(offset=0.1).apply(SETUP))
DEEP = Push(kind="top", side="top", place=(0.02, 0.0, TOP), depth=5e-3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    """A camera that sees the top and two sides, six points to a patch with 0.3 mm of noise; nuisances known exactly."""
    surface = Surface(SETUP.box)
    seen = (surface.patch_normals @ [-0.6, -0.5, 0.6]) > 0
    return Scene(
        stated=NOTHING, lumps=(), centres=surface.patch_centres, normals=surface.patch_normals, count=np.where(seen, 6.0, 0.0),
        variance=np.full(surface.patches, 9e-8), eye=EYE, pivot=np.array([0.0, 0.0, TOP]), grid=GRID, temperature=1.0,
    )  # fmt: skip


def _nats(scene: Scene, push: Push, other: Survivor = LUMP) -> tuple[float, float]:
    return nats_of(scene, [(NOTHING, other)], push)[0]


def test_divergence_is_that_of_two_gaussians_with_one_covariance():
    random = np.random.default_rng(0)
    difference, blur, weights = random.standard_normal(9), random.standard_normal((9, 3)), random.uniform(0.5, 2.0, 9)
    covariance = np.diag(1 / weights) + blur @ blur.T
    parts = [(difference[:4], blur[:4], weights[:4]), (difference[4:], blur[4:], weights[4:])]
    assert _divergence(parts) == pytest.approx(0.5 * difference @ np.linalg.solve(covariance, difference))


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
    assert best[0].push.side == "top" and np.linalg.norm(np.subtract(best[0].push.place[:2], (0.02, 0.0))) < 0.011
    row = best[0].to_json()
    assert row["separates"] == ["none", "stiff_inclusion"] and row["direction"] == [0.0, 0.0, -1.0]
    assert row["nats"] > 0 and 0 <= row["probability"] <= 1 and row["text"].startswith("press")
    assert len({one.push.side for one in best}) == len(best) > 1 and best[0].nats >= best[1].nats
