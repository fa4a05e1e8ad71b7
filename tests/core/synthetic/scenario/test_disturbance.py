"""Disturbances outside the catalogue: sizes, and their traces in the files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from palpate.dataset import open_dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import EffectError
from palpate.foundation.frames import Transform
from palpate.synthetic import (
    DISTURBANCES,
    Disturbance,
    Scenario,
    draw_disturbance,
    make_dataset,
    truth_path,
)
from palpate.synthetic.bench.motion_plan import MotionPlan
from palpate.synthetic.bench.solved_track import SolvedTrack
from palpate.synthetic.bench.true_body import solid_model
from palpate.synthetic.bench.virtual_experiment import solve_motion
from palpate.synthetic.laws.stiffness_fields import wave_factor
from palpate.synthetic.make_dataset import motions
from palpate.synthetic.scenario.disturbance import drifted, rippled
from palpate.synthetic.solver.tet_block import TetGrading, mesh_block

DRIFT = Disturbance("camera_drift", {"translation": 1.5e-3, "rotation": 0.02})
RIPPLE = Disturbance("depth_ripple", {"amplitude": 2e-3, "period": 20e-3})
BODY = Disturbance("second_body", {"overlap": 2e-3, "stiffness_over_E": 100.0, "side": "-x"})
SHAFT = Disturbance("shaft_contact", {"lean": 0.05})


def _drift(share: float, disturbances: tuple[Disturbance, ...] = (DRIFT,)) -> Transform:
    return drifted(disturbances, share, np.random.default_rng(4))


def test_camera_is_right_half_way_and_off_either_way_at_the_ends() -> None:
    assert np.allclose(_drift(0.5).matrix, np.eye(4))
    for share in (0.0, 1.0):
        assert np.linalg.norm(_drift(share).translation) == pytest.approx(1.5e-3)
        assert Rotation.from_matrix(_drift(share).rotation).magnitude() == pytest.approx(0.02)
    assert _drift(0.0).translation == pytest.approx(-_drift(1.0).translation)


def test_depth_ripples_about_the_truth() -> None:
    depth = np.linspace(0.3, 0.4, 2001)
    off = rippled([RIPPLE], depth) / depth - 1.0
    assert np.abs(off).max() == pytest.approx(2e-3, rel=1e-3)
    assert abs(off.mean()) < 1e-5
    assert np.allclose(rippled([RIPPLE], depth + 20e-3) / (depth + 20e-3) - 1.0, off)


def test_stiffness_goes_up_and_down_along_its_direction_alone() -> None:
    numbers = {"amplitude": 0.5, "period": 0.04, "direction": 0.5 * np.pi, "phase": 0.0}
    waves = Disturbance("stiffness_waves", numbers)
    way = np.linspace(-0.02, 0.02, 5)
    along, across = (np.zeros((5, 3)) for _ in range(2))
    along[:, 1] = way
    across[:, 0], across[:, 2] = way, 0.01
    assert np.log(wave_factor(waves, along)) == pytest.approx([0.0, -0.5, 0.0, 0.5, 0.0])
    assert wave_factor(waves, across) == pytest.approx(1.0)
    block = mesh_block(
        Scenario().size, TetGrading(np.zeros((1, 3)), np.zeros(1), np.full(1, 0.012))
    )
    even, uneven = (
        solid_model(Scenario(disturbances=one), block).young_modulus for one in ((), (waves,))
    )
    assert uneven == pytest.approx(even * wave_factor(waves, block.places))


def test_no_disturbance_disturbs_nothing() -> None:
    depth = np.linspace(0.3, 0.4, 11)
    assert np.array_equal(rippled([], depth), depth) and np.array_equal(
        rippled([DRIFT], depth), depth
    )
    assert np.array_equal(_drift(0.0, ()).matrix, np.eye(4)) and np.array_equal(
        _drift(0.0, (RIPPLE,)).matrix, np.eye(4)
    )


@pytest.mark.parametrize("name", DISTURBANCES)
def test_drawn_ones_are_clear_and_repeat_themselves(name: str) -> None:
    drawn = draw_disturbance(name, 5)
    assert drawn.name == name and drawn == draw_disturbance(name, 5) != draw_disturbance(name, 6)
    assert all(isinstance(value, str) or value > 0 for value in drawn.parameters.values())


@pytest.mark.parametrize(
    ("name", "parameters", "words"),
    [
        ("moon", {}, "cannot disturb by 'moon'; it knows camera_drift, depth_ripple"),
        ("depth_ripple", {"period": 0.1}, "needs the parameters"),
    ],
)
def test_unknown_disturbances_and_missing_numbers_are_errors(
    name: str, parameters: dict[str, float], words: str
) -> None:
    with pytest.raises(EffectError, match=words):
        Disturbance(name, parameters)
    with pytest.raises(EffectError, match="cannot disturb by 'moon'"):
        draw_disturbance("moon", 0)


def _performed(sequence: str, *disturbances: Disturbance) -> tuple[MotionPlan, SolvedTrack]:
    """A motion of the coarse bench, as planned and as carried out."""
    scenario = Scenario(disturbances=disturbances, sequences=(sequence,), fine=4.5e-3)
    planned = motions(scenario, np.array([1.0, 1.0]), seed=3)[0]
    return planned, solve_motion(scenario, planned)


def _top_rim(track: SolvedTrack, axis: int) -> FloatArray:
    """Displacement (k, 3) [m] of the rim of the top on the positive side of an axis when the first
    push is deepest.
    """
    solved = track.solved_pushes[0]
    size = Scenario().size
    rim = (np.abs(solved.rest[:, axis] - size[axis] / 2) < 1e-6) & (
        np.abs(solved.rest[:, 2] - size[2]) < 1e-6
    )
    return np.asarray(solved.displacement(solved.deepest[1])[rim])


def test_phantom_creeps_evenly_all_the_time_and_the_tool_meets_it_where_it_is() -> None:
    creep = Disturbance("phantom_creep", {"speed": 8e-5, "direction": 0.5 * np.pi})
    motion, track = _performed("poke-top-01", creep)
    for time in (
        0.3,
        1.5,
        *(float(push.times[1]) for push in motion.pushes),
        motion.duration - 0.1,
    ):
        solved = track.at(time)
        moved = solved.displacement(time)[solved.rest[:, 2] < 1e-6]
        assert np.allclose(moved, [0.0, 8e-5 * time, 0.0], atol=1.5e-6)
    last = motion.pushes[-1]
    deepest = float(last.times[1]) + 0.1
    surface, ball = track.surface(deepest)[0], motion.centre(np.array([deepest]))[0]
    touching = np.linalg.norm(surface - ball, axis=1).min()
    assert touching == pytest.approx(Scenario().tool_radius, abs=0.1e-3)


def test_shaft_that_touches_the_rim_dents_it_and_one_that_is_clear_does_not() -> None:
    (clear, plain), (leaning, touched) = (
        _performed("poke-side-01"),
        _performed("poke-side-01", SHAFT),
    )
    assert clear.axis[1] < 0 < leaning.axis[1]  # the first push from the side is into the +y face
    assert [push.waypoints.tolist() for push in clear.pushes] == [
        push.waypoints.tolist() for push in leaning.pushes
    ]
    before, after = (float(-_top_rim(track, axis=1)[:, 1].min()) for track in (plain, touched))
    assert after > before + 0.8e-3


def test_shaft_is_clear_of_a_block_that_is_pushed_from_above() -> None:
    (_, plain), (_, touched) = _performed("poke-top-01"), _performed("poke-top-01", SHAFT)
    assert np.allclose(plain.surface(4.0)[0], touched.surface(4.0)[0], atol=1e-6)


def test_second_body_pushes_its_side_in_and_holds_it() -> None:
    (_, plain), (_, pressed) = _performed("poke-side-02"), _performed("poke-side-02", BODY)
    rest = pressed.solved_pushes[0].rest
    side = np.abs(rest[:, 0] + Scenario().size[0] / 2) < 1e-6
    settled = pressed.solved_pushes[0].settled[side]
    middle = np.abs(rest[side] - [-Scenario().size[0] / 2, 0.0, 0.02]).max(axis=1) < 8e-3
    assert (settled[middle, 0] > 0.5e-3).all() and settled[
        :, 0
    ].max() < 2e-3  # gives way, and so does the body
    assert np.abs(plain.solved_pushes[0].settled).max() < 1e-6
    at = [
        track.solved_pushes[0].displacement(track.solved_pushes[0].deepest[1])
        - track.solved_pushes[0].settled
        for track in (plain, pressed)
    ]
    away = [-float(moved[side][middle, 0].mean()) for moved in at]
    assert 0 < away[1] < 0.9 * away[0]  # pushed from the other side, towards the body


def test_camera_never_sees_the_side_that_a_body_lies_against(tmp_path: Path) -> None:
    quick = {
        "sequences": ("poke-top-01",),
        "fine": 5e-3,
        "density": 900,
        "rate": 0.5,
        "robot_rate": 100.0,
    }
    for side, axis, sign in (("-x", 0, 1.0), ("+y", 1, -1.0)):
        one = Disturbance("second_body", {**BODY.parameters, "side": side})
        made = make_dataset(tmp_path / side, Scenario(disturbances=(one,), **quick), seed=3)  # type: ignore[arg-type]
        assert sign * made.phantom_from_camera.translation[axis] > 0.05


def _table(pose: Transform, cloud: FloatArray) -> FloatArray:
    """Height over the table (n,) [m] of the points far from the block, taken to be where the camera
    was registered.
    """
    points = pose.apply(cloud)
    return np.asarray(
        points[(np.abs(points[:, 2]) < 6e-3) & (np.linalg.norm(points[:, :2], axis=1) > 0.05), 2]
    )


@pytest.mark.parametrize("one", [DRIFT, RIPPLE], ids=lambda one: one.name)
def test_files_show_a_disturbance_and_the_truth_says_unexplained(
    one: Disturbance, tmp_path: Path
) -> None:
    quick = {
        "sequences": ("poke-top-01",),
        "fine": 4.5e-3,
        "density": 900,
        "rate": 1.0,
        "robot_rate": 200.0,
    }
    spread = {}
    for name, disturbances in (("plain", ()), ("disturbed", (one,))):
        truth = make_dataset(tmp_path / name, Scenario(disturbances=disturbances, **quick), seed=3)  # type: ignore[arg-type]
        dataset = open_dataset(tmp_path / name)
        first = dataset.sequence("poke-top-01").cloud(0)
        spread[name] = [
            float(np.std(_table(truth.phantom_from_camera, cloud)))
            for cloud in (dataset.rest_cloud(), first)
        ]
    saved = json.loads(truth_path(tmp_path / "disturbed").read_text())
    assert (saved["verdict"], saved["effects"]) == ("unexplained", [])
    assert saved["disturbances"][0]["effect"] == one.name
    assert "disturbances" not in json.loads(truth_path(tmp_path / "plain").read_text())
    rest, begun = (
        after / before for before, after in zip(spread["plain"], spread["disturbed"], strict=True)
    )
    assert begun > 1.1
    assert rest > 1.1 if one is RIPPLE else rest == pytest.approx(1.0)
