"""The same touches under another belief about where they were made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import CORNERS, GRID, SETUP, TOP

from palpate.effects.geometry import GeometryScale
from palpate.effects.tool import LandmarkMismatch
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.foundation.frames import Transform
from palpate.measurement.touch_correction import touch_correction, touch_misses, touched_places
from palpate.registration.robot.robot_fit import fit_robot
from palpate.setup.setup import PAIRINGS, Setup, Touching

TRUE = Transform.from_vector([0.1, -0.2, 0.3], [0.4, -1.1, 0.7])
"""phantom_from_robot"""
LIFT = np.array([0.0, 0.0, 5e-3])
STATED = replace(SETUP, landmarks=CORNERS, touching=Touching(lift=LIFT[2]))


def _mismatch(
    pairing: str = "as-paired", scale: float = 1.0, inset: float = 0.0
) -> LandmarkMismatch:
    return LandmarkMismatch(pairing=pairing, scale=scale, inset=inset)


def _registered(truth: Setup, noise: float = 2e-4) -> tuple[Setup, FloatArray]:
    """The setup as an experimenter has it who touched as in `truth`, and the touches (n, 3) [m],
    robot frame.
    """
    error = noise * np.random.default_rng(3).standard_normal((4, 3))
    touches = TRUE.inverse().apply(touched_places(truth) + LIFT + error)
    fit = fit_robot(touches, np.array(CORNERS) + LIFT)
    misses = tuple((float(x), float(y), float(z)) for x, y, z in fit.residuals)
    return replace(
        truth,
        phantom_from_robot=fit.phantom_from_robot,
        touching=replace(truth.touching, misses=misses),
    ), touches


TRUTHS = {
    **{pairing: _mismatch(pairing).apply(STATED) for pairing in PAIRINGS[1:]},
    "turned, shrunk and inside": _mismatch("turn-3", 0.85, 2e-3).apply(STATED),
    "size": GeometryScale(scale_x=1.05, scale_y=0.96, scale_z=1.04).apply(STATED),
}


@pytest.mark.parametrize("name", TRUTHS)
def test_correction_leads_to_the_fit_of_the_same_touches_where_they_were_made(name: str):
    setup, touches = _registered(TRUTHS[name])
    wanted = fit_robot(touches, touched_places(TRUTHS[name]) + LIFT)
    found = touch_correction(setup, GRID) @ setup.phantom_from_robot
    assert np.allclose(found.matrix, wanted.phantom_from_robot.matrix, atol=1e-9)
    assert np.allclose(touch_misses(setup, GRID), wanted.residuals, atol=1e-9)
    assert np.linalg.norm((found.apply(touches) - TRUE.apply(touches)), axis=1).max() < 6e-4


def test_without_misses_the_landmarks_are_enough_where_they_settle_the_pose():
    for truth in (TRUTHS["turn-1"], TRUTHS["turn-2"], TRUTHS["size"]):
        setup, _ = _registered(truth, noise=0.0)
        bare = replace(setup, touching=replace(setup.touching, misses=()))
        assert np.allclose(
            (touch_correction(bare, GRID) @ setup.phantom_from_robot).matrix, TRUE.matrix, atol=1e-9
        )


def test_polygon_of_another_size_moves_nothing_and_shows_in_the_misses():
    for mismatch, reach in (
        (_mismatch(scale=0.85), 0.15 * np.hypot(*CORNERS[0][:2])),
        (_mismatch(inset=3e-3), 3e-3 * np.sqrt(2)),
    ):
        setup, _ = _registered(mismatch.apply(STATED), noise=0.0)
        believed = replace(
            setup, touching=Touching(misses=setup.touching.misses, lift=setup.touching.lift)
        )
        assert np.allclose(touch_correction(setup, GRID).matrix, np.eye(4), atol=1e-9)
        assert np.allclose(np.linalg.norm(touch_misses(believed, GRID), axis=1), reach, rtol=1e-6)
        assert np.abs(touch_misses(setup, GRID)).max() < 1e-9


def test_inset_leaves_the_edges_and_scale_the_middle():
    inside, smaller = (
        touched_places(one.apply(STATED)) for one in (_mismatch(inset=2e-3), _mismatch(scale=0.9))
    )
    assert np.allclose(np.abs(np.array(CORNERS)) - np.abs(inside), [2e-3, 2e-3, 0.0])
    assert np.allclose(smaller[:, :2], 0.9 * np.array(CORNERS)[:, :2]) and np.allclose(
        smaller[:, 2], TOP
    )


def test_stated_touches_need_no_correction():
    setup, _ = _registered(STATED)
    assert np.array_equal(touch_correction(setup, GRID).matrix, np.eye(4))
    assert np.array_equal(
        touch_correction(replace(TRUTHS["turn-1"], landmarks=()), GRID).matrix, np.eye(4)
    )
    assert np.allclose(touch_misses(setup, GRID), setup.touching.misses, atol=1e-9)


def test_pairings_are_words_that_need_their_touches():
    assert [
        Touching(pairing=pairing).order(4)
        for pairing in ("as-paired", "swap-2-3", "turn-1", "turn-3")
    ] == [[0, 1, 2, 3], [0, 2, 1, 3], [1, 2, 3, 0], [3, 0, 1, 2]]
    assert len({tuple(Touching(pairing=pairing).order(4)) for pairing in PAIRINGS}) == len(PAIRINGS)
    for pairing in ("swap-1-4", "turn-3"):
        with pytest.raises(SetupError, match=f"{pairing}.*3"):
            Touching(pairing=pairing).order(3)
    with pytest.raises(SetupError, match=r"'mirrored' is none of as-paired, swap-1-2"):
        Touching(pairing="mirrored")
    with pytest.raises(SetupError, match="2 touches miss 4 landmarks"):
        replace(STATED, touching=Touching(misses=((0.0, 0.0, 0.0),) * 2))
