"""Nuisances of robots, tools and phantoms, and their draws."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.errors import RunError
from palpate.setup.depth_filters import DEPTH_FILTERS
from palpate.synthetic.nuisances import FILTERS, NUISANCES, StatedMotion, draw_nuisances
from palpate.synthetic.nuisances.depth_noise import StereoNoise
from palpate.synthetic.nuisances.phantom_form import Draft, RoundedEdges, SaggingTop
from palpate.synthetic.nuisances.robot_errors import (
    Backlash,
    CableStretch,
    CalibrationError,
    EncoderSteps,
    RobotRate,
)
from palpate.synthetic.nuisances.tool_form import Neck, OtherShaft, OutOfRound

SIZE = (0.07, 0.04, 0.036)


def forth_and_back() -> StatedMotion:
    """A tool that goes down for a second, stands for one, and comes back."""
    times = np.linspace(0.0, 3.0, 301)
    height = np.interp(times, [0, 1, 2, 3], [0.01, 0.0, 0.0, 0.01])
    centres = np.column_stack([np.zeros((301, 2)), height])
    forces = np.column_stack([np.zeros((301, 2)), (0.01 - height) * 50])
    return StatedMotion(times, centres, np.gradient(centres, times, axis=0), forces)


def test_backlash_is_off_by_its_width_on_the_way_back() -> None:
    motion = forth_and_back()
    off = Backlash(0.2e-3).stated(motion)[:, 2] - motion.centres[:, 2]
    assert off[50] == pytest.approx(-0.1e-3)
    assert off[150] == pytest.approx(-0.1e-3)
    assert off[250] == pytest.approx(0.1e-3)


def test_cables_stretch_with_the_force() -> None:
    motion = forth_and_back()
    off = motion.centres - CableStretch(2e-3, 1e-3).stated(motion)
    assert off[150] == pytest.approx((0.0, 0.0, 0.5e-3))


def test_calibration_error_is_nearly_rigid_over_a_phantom() -> None:
    error = CalibrationError(2e-3, 0.25, 3)
    places = np.random.default_rng(0).uniform(-1, 1, (500, 3)) * (0.035, 0.02, 0.018)
    still = np.zeros_like(places)
    off = error.stated(StatedMotion(np.arange(500.0), places, still, still)) - places
    assert 0.2e-3 < np.linalg.norm(off.mean(axis=0)) < 8e-3
    assert np.linalg.norm(off - off.mean(axis=0), axis=1).max() < 2e-3


def test_encoders_step_and_rates_are_set() -> None:
    motion = forth_and_back()
    stepped = EncoderSteps(50e-6).stated(motion)
    assert np.abs(stepped - motion.centres).max() <= 25.1e-6
    assert RobotRate(50.0).robot_rate == 50.0


def test_rounded_edges_leave_faces_alone() -> None:
    rounding = RoundedEdges(2e-3)
    points = np.array([[0.0, 0.0, 0.036], [0.035, 0.0, 0.01], [0.035, 0.0, 0.036], [0.035, 0, 0]])
    moved = rounding.form(points, SIZE)
    assert moved[0] == pytest.approx(points[0])
    assert moved[1] == pytest.approx(points[1])
    assert moved[2] == pytest.approx(points[2] - 2e-3 * (1 - np.sqrt(0.5)) * np.array([1, 0, 1]))
    assert moved[3] == pytest.approx(points[3])


def test_draft_and_sag() -> None:
    top, foot = np.array([[0.035, 0.0, 0.036]]), np.array([[0.035, 0.0, 0.0]])
    lean = np.tan(np.deg2rad(1)) * 0.018
    assert Draft(np.deg2rad(1)).form(top, SIZE)[0, 0] == pytest.approx(0.035 - lean)
    assert Draft(np.deg2rad(1)).form(foot, SIZE)[0, 0] == pytest.approx(0.035 + lean)
    middle = np.array([[0.0, 0.0, 0.036]])
    assert SaggingTop(-0.3e-3).form(middle, SIZE)[0, 2] == pytest.approx(0.0357)
    assert SaggingTop(-0.3e-3).form(top, SIZE) == pytest.approx(top)


def test_tools_change_their_form() -> None:
    circle = np.linspace(0, 2 * np.pi, 30)
    ring = np.column_stack([np.cos(circle), np.sin(circle), np.zeros(30)])
    ball = (np.random.default_rng(0).normal(size=(500, 3)), np.zeros((1, 3)))
    ball[0][:] *= 5e-3 / np.linalg.norm(ball[0], axis=1, keepdims=True)
    rod = (np.concatenate([ring * 3e-3, ring * 3e-3 + (0, 0, 0.16)]), np.zeros((1, 3)))
    thick = OtherShaft(1.2).tool([ball, rod], 5e-3)[1][0]
    assert np.linalg.norm(thick[:, :2], axis=1).max() == pytest.approx(6e-3)
    _, shaft, neck = Neck(4e-3).tool([ball, rod], 5e-3)
    assert shaft[0][:, 2].min() == pytest.approx(9e-3)
    assert np.linalg.norm(neck[0][:, :2], axis=1).max() == pytest.approx(1.5e-3)
    oval = np.linalg.norm(OutOfRound(0.1e-3, 1).tool([ball, rod], 5e-3)[0][0], axis=1)
    assert oval.max() == pytest.approx(5.1e-3, abs=0.02e-3)
    assert oval.min() == pytest.approx(4.9e-3, abs=0.02e-3)


def test_draws_hold_no_cause_and_repeat() -> None:
    for seed in range(40):
        drawn = draw_nuisances(seed)
        assert drawn == draw_nuisances(seed)
        assert not any(one.causes for one in drawn)
        assert sum(type(one) in FILTERS.values() for one in drawn) <= 1
        order = [NUISANCES.index(type(one)) for one in drawn]
        assert order == sorted(order)


def test_every_nuisance_without_a_cause_is_drawn_sometimes() -> None:
    met = {type(one) for seed in range(200) for one in draw_nuisances(seed)}
    assert met == {kind for kind in NUISANCES if not kind.causes}


def test_noisy_draws_have_one_to_three_millimetres() -> None:
    for noisy, low, high in ((False, 0.3e-3, 1e-3), (True, 1e-3, 3e-3)):
        drawn = [draw_nuisances(seed, noisy=noisy) for seed in range(50)]
        sizes = [one.sigma for all_ in drawn for one in all_ if isinstance(one, StereoNoise)]
        assert len(sizes) == 50
        assert low <= min(sizes) < max(sizes) <= high


def test_cameras_and_filters_by_name() -> None:
    drawn = draw_nuisances(5, camera="d405", filters=["temporal", "spatial"])
    noise = next(one for one in drawn if isinstance(one, StereoNoise))
    assert noise.sigma == pytest.approx(0.81e-3, rel=0.02)
    assert {type(one) for one in drawn} >= {FILTERS["temporal"], FILTERS["spatial"]}
    with pytest.raises(RunError, match="no camera 'd999'; it has d405"):
        draw_nuisances(5, camera="d999")
    with pytest.raises(RunError, match="no filter 'magic'; it has decimation"):
        draw_nuisances(5, filters=["magic"])


def test_every_filter_of_the_bench_can_be_declared_in_a_dataset() -> None:
    assert set(FILTERS) == set(DEPTH_FILTERS)
