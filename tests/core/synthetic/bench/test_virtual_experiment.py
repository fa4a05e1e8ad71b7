"""Hidden effects on the virtual bench do what their names say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.foundation.errors import SolveError
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush, draw_motion
from palpate.synthetic.bench.solved_track import SolvedTrack
from palpate.synthetic.bench.virtual_experiment import rest_surface, solve_motion
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.tet_equilibrium import InstabilityError

SEEN = np.array([1.0, 1.0])
COARSE = 3.6e-3


def _first_push(name: str, seed: int = 3) -> MotionPlan:
    scenario = Scenario()
    motion = draw_motion(name, 0, scenario.size, scenario.tool_radius, SEEN, seed)
    return replace(motion, pushes=motion.pushes[:1])


def _track(name: str, *effects: HiddenEffect) -> SolvedTrack:
    return solve_motion(Scenario(effects=effects), _first_push(name), COARSE)


@pytest.fixture(scope="module")
def slipped() -> SolvedTrack:
    return _track("poke-side-01", HiddenEffect("base_slip", {"friction_coefficient": 0.08}))


def test_friction_always_holds_the_sliding_base(slipped: SolvedTrack) -> None:
    weight = Scenario().mass * 9.81
    for key_frame in slipped.key_frames:
        assert (
            np.linalg.norm(key_frame.tool_force[:2])
            <= 0.08 * (weight - key_frame.tool_force[2]) * 1.001
        )


def test_base_stays_where_it_was_pushed(slipped: SolvedTrack) -> None:
    slips = np.array(
        [key_frame.slip for key_frame in slipped.solved_pushes[0].segments[0].key_frames]
    )
    assert slips[-1][1] < -0.2e-3
    assert np.all(np.diff(slips[:, 1]) <= 1e-9)
    after = slipped.solved_pushes[0].displacement(slipped.motion.duration)
    assert np.allclose(after[:, :2], slips[-1], atol=1e-5)


def test_block_returns_to_its_shape_after_a_poke() -> None:
    track = _track("poke-top-01")
    solved = track.solved_pushes[0]
    assert np.allclose(solved.displacement(track.motion.duration), 0.0, atol=1e-6)
    assert np.abs(solved.displacement(solved.deepest[1])).max() > 2e-3


def test_detached_strip_lifts_and_does_not_sink_into_the_table() -> None:
    track = _track("poke-side-01", HiddenEffect("base_detachment", {"edge": "+y", "extent": 0.015}))
    solved = track.solved_pushes[0]
    moved = solved.rest + solved.displacement(solved.deepest[1])
    assert moved[:, 2].min() > -0.1e-3
    foot = (solved.rest[:, 2] < 1e-9) & (solved.rest[:, 1] > 0.019)
    held = _track("poke-side-01").solved_pushes[0]
    still = (held.rest[:, 2] < 1e-9) & (held.rest[:, 1] > 0.019)
    assert np.abs(moved - solved.rest)[foot].max() > 0.1e-3
    assert np.allclose(held.displacement(held.deepest[1])[still], 0.0)


def test_heavier_block_sags_further() -> None:
    sags = []
    for weight in (1.0, 2.0):
        _, settled, _ = rest_surface(
            Scenario(effects=(HiddenEffect("gravity", {"specific_weight_over_stiffness": weight}),))
        )
        sags.append(-settled[:, 2].min())
    assert 1.9 < sags[1] / sags[0] < 2.4


def test_keys_are_dense_enough_to_interpolate(monkeypatch: pytest.MonkeyPatch) -> None:
    track = _track("poke-top-01")
    monkeypatch.setattr("palpate.synthetic.bench.push_segments.KEY_SPACING", 0.35e-3)
    dense = _track("poke-top-01")
    first = track.solved_pushes[0].segments[0]
    for instant in np.linspace(first.begin, first.end, 9):
        error = track.solved_pushes[0].displacement(instant) - dense.solved_pushes[0].displacement(
            instant
        )
        assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.03e-3


@pytest.mark.more
def test_push_onto_a_hard_lump_stops_before_the_block_is_unstable() -> None:
    lump = {"x": -0.0025, "y": 0.0009, "z": 0.0243, "radius": 0.0086, "stiffness_ratio": 9.1}
    top = np.array([-0.00303, 0.00161, 0.0473])
    planned = PlannedPush(
        np.array([top, [-0.00303, 0.00161, 0.0334]]),
        np.array([0.0, 2.0, 3.0, 5.0]),
        np.array([0.0, 13.9e-3, 13.9e-3, 0.0]),
    )
    motion = MotionPlan("poke-top-01", np.array([0.0, 0.0, -1.0]), (planned,), 6.0)
    track = solve_motion(Scenario(effects=(HiddenEffect("stiff_inclusion", lump),)), motion)
    (done,) = track.motion.pushes
    assert 0.9e-3 < planned.corners[1] - done.corners[1] < 4.5e-3
    assert np.allclose(
        track.motion.centre(np.array([0.0, 2.5, 5.0])), [top, done.waypoints[1], top]
    )
    assert track.key_frames[0].tool_force[2] == 0.0
    assert max(-key_frame.tool_force[2] for key_frame in track.key_frames) > 0.3


def test_solver_failure_of_a_stable_block_is_no_instability(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "palpate.synthetic.solver.tet_equilibrium.TetSolver._search", lambda *_: 0.0
    )
    with pytest.raises(SolveError, match="no equilibrium") as failure:
        _track("poke-top-01")
    assert not isinstance(failure.value, InstabilityError)
