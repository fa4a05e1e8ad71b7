"""Hidden effects on the virtual bench do what their names say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.foundation.errors import SolveError
from palpate.synthetic.bench.motion_plan import Motion, Probe, draw_motion
from palpate.synthetic.bench.solved_track import Track
from palpate.synthetic.bench.virtual_experiment import perform, rest_surface
from palpate.synthetic.scenario.scenario import HiddenEffect, Scenario
from palpate.synthetic.solver.tet_equilibrium import GivesWay

SEEN = np.array([1.0, 1.0])
COARSE = 3.6e-3


def _first_probe(name: str, seed: int = 3) -> Motion:
    scenario = Scenario()
    motion = draw_motion(name, 0, scenario.size, scenario.tool_radius, SEEN, seed)
    return replace(motion, probes=motion.probes[:1])


def _track(name: str, *effects: HiddenEffect) -> Track:
    return perform(Scenario(effects=effects), _first_probe(name), COARSE)


@pytest.fixture(scope="module")
def slipped() -> Track:
    return _track("poke-side-01", HiddenEffect("base_slip", {"friction_coefficient": 0.08}))


def test_friction_always_holds_the_sliding_base(slipped: Track) -> None:
    weight = Scenario().mass * 9.81
    for moment in slipped.moments:
        assert np.linalg.norm(moment.push[:2]) <= 0.08 * (weight - moment.push[2]) * 1.001


def test_base_stays_where_it_was_pushed(slipped: Track) -> None:
    slips = np.array([moment.slip for moment in slipped.stretches[0].passages[0].moments])
    assert slips[-1][1] < -0.2e-3
    assert np.all(np.diff(slips[:, 1]) <= 1e-9)
    after = slipped.stretches[0].displacement(slipped.motion.duration)
    assert np.allclose(after[:, :2], slips[-1], atol=1e-5)


def test_block_returns_to_its_shape_after_a_poke() -> None:
    track = _track("poke-top-01")
    stretch = track.stretches[0]
    assert np.allclose(stretch.displacement(track.motion.duration), 0.0, atol=1e-6)
    assert np.abs(stretch.displacement(stretch.deepest[1])).max() > 2e-3


def test_detached_strip_lifts_and_does_not_sink_into_the_table() -> None:
    track = _track("poke-side-01", HiddenEffect("base_detachment", {"edge": "+y", "extent": 0.015}))
    stretch = track.stretches[0]
    moved = stretch.rest + stretch.displacement(stretch.deepest[1])
    assert moved[:, 2].min() > -0.1e-3
    foot = (stretch.rest[:, 2] < 1e-9) & (stretch.rest[:, 1] > 0.019)
    held = _track("poke-side-01").stretches[0]
    still = (held.rest[:, 2] < 1e-9) & (held.rest[:, 1] > 0.019)
    assert np.abs(moved - stretch.rest)[foot].max() > 0.1e-3
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
    monkeypatch.setattr("palpate.synthetic.bench.specimen.KEY_SPACING", 0.35e-3)
    dense = _track("poke-top-01")
    first = track.stretches[0].passages[0]
    for instant in np.linspace(first.begin, first.end, 9):
        error = track.stretches[0].displacement(instant) - dense.stretches[0].displacement(instant)
        assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.03e-3


def test_push_onto_a_hard_lump_stops_short_of_where_the_block_gives_way() -> None:
    lump = {"x": -0.0025, "y": 0.0009, "z": 0.0243, "radius": 0.0086, "stiffness_ratio": 9.1}
    top = np.array([-0.00303, 0.00161, 0.0473])
    planned = Probe(
        np.array([top, [-0.00303, 0.00161, 0.0334]]),
        np.array([0.0, 2.0, 3.0, 5.0]),
        np.array([0.0, 13.9e-3, 13.9e-3, 0.0]),
    )
    motion = Motion("poke-top-01", np.array([0.0, 0.0, -1.0]), (planned,), 6.0)
    track = perform(Scenario(effects=(HiddenEffect("stiff_inclusion", lump),)), motion)
    (done,) = track.motion.probes
    assert 0.9e-3 < planned.corners[1] - done.corners[1] < 4.5e-3
    assert np.allclose(
        track.motion.centre(np.array([0.0, 2.5, 5.0])), [top, done.waypoints[1], top]
    )
    assert track.moments[0].push[2] == 0.0
    assert max(-moment.push[2] for moment in track.moments) > 0.3


def test_solver_that_fails_where_the_block_stands_firm_is_not_taken_for_that(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(
        "palpate.synthetic.solver.tet_equilibrium.Equilibrium._search", lambda *_: 0.0
    )
    with pytest.raises(SolveError, match="no equilibrium") as failure:
        _track("poke-top-01")
    assert not isinstance(failure.value, GivesWay)
