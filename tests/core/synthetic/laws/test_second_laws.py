"""Both laws of an effect agree where they should, and differ elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from virtual_push import hide

from palpate.blind import Case, scenario_of
from palpate.foundation.frames import Transform
from palpate.synthetic.laws import SECOND_LAWS, with_second_laws
from palpate.synthetic.laws.sensor_laws import camera_motion, clock_offset, depth_curvature
from palpate.synthetic.laws.stiffness_fields import (
    fibre_families,
    gradient_factor,
    in_inclusion,
    layer_factor,
    uneven_density,
    uneven_poisson_ratio,
)
from palpate.synthetic.laws.support_laws import is_bonded, slip_limit, spring_factor
from palpate.synthetic.laws.tool_laws import drag_limits, offset_at, shaft_softness
from palpate.synthetic.scenario.hidden_effects import HIDDEN, HiddenEffect
from palpate.synthetic.scenario.scenario_draws import draw_scenario

SIZE = (0.07, 0.04, 0.036)
HEIGHT = np.linspace(0.0, 1.0, 101)
ONE_LAW = {"tool_radius", "landmark_mismatch", "geometry_scale", "young_modulus", "geometry_local"}


def _second(effect: str, **parameters: float | str) -> HiddenEffect:
    return replace(hide(effect, **parameters), second_law=True)


def test_every_effect_has_a_second_law_but_those_that_are_named():
    assert set(SECOND_LAWS) | ONE_LAW == set(HIDDEN)
    for effect, law in SECOND_LAWS.items():
        assert set(law.kept) <= set(HIDDEN[effect])


def test_law_is_drawn_with_the_seed_and_leaves_the_parameters_alone():
    drawn = []
    for seed in range(40):
        scenario = draw_scenario(seed, among=["gravity"])
        first, again = (with_second_laws(scenario, seed).effects[0] for _ in range(2))
        assert first == again
        assert first.parameters == scenario.effects[0].parameters
        drawn.append(first.second_law)
    assert 10 < sum(drawn) < 30


def test_bench_without_nuisances_keeps_the_catalogues_law():
    laws = {True: 0, False: 0}
    for seed in range(20):
        case = Case("gravity", seed, "clear", ("gravity",), True)
        for nuisances in laws:
            hidden = scenario_of(replace(case, nuisances=nuisances)).effects[0]
            laws[nuisances] += hidden.second_law
    assert laws[False] == 0 < laws[True]


def test_ellipsoid_has_the_volume_of_the_ball():
    lump = {"x": 0.0, "y": 0.0, "z": 0.0, "radius": 1.0, "stiffness_ratio": 5.0}
    places = np.random.default_rng(0).uniform(-1.3, 1.3, (200_000, 3))
    ball, other = (
        in_inclusion(law, places)
        for law in (hide("stiff_inclusion", **lump), _second("stiff_inclusion", **lump))
    )
    assert other.mean() == pytest.approx(ball.mean(), rel=0.02)
    assert (ball != other).mean() > 0.05


def test_layer_fades_below_itself():
    layer = {"thickness": 3e-3, "stiffness_ratio": 8.0}
    depth = np.array([1e-3, 2.9e-3, 3.1e-3, 20e-3])
    sharp = layer_factor(hide("surface_layer", **layer), depth)
    fading = layer_factor(_second("surface_layer", **layer), depth)
    assert sharp.tolist() == [8.0, 8.0, 1.0, 1.0]
    assert fading[:2].tolist() == [8.0, 8.0]
    assert 6.0 < fading[2] < 8.0
    assert fading[3] == pytest.approx(1.0, abs=1e-3)


def test_gradients_have_the_same_ratio_of_top_to_bottom():
    one, other = (
        gradient_factor(law("stiffness_gradient", log_ratio=1.5), HEIGHT) for law in (hide, _second)
    )
    assert one[-1] / one[0] == pytest.approx(np.exp(1.5))
    assert other[-1] / other[0] == pytest.approx(np.exp(1.5))
    assert np.ptp(np.diff(other)) == pytest.approx(0.0, abs=1e-12)


def test_uneven_fields_keep_their_mean():
    weight, nu = (
        _second("gravity", specific_weight_over_stiffness=2.0),
        _second("poisson_ratio", nu=0.2),
    )
    assert np.mean(uneven_density(weight, HEIGHT)) == pytest.approx(1.0)
    assert np.mean(uneven_poisson_ratio(nu, HEIGHT)) == pytest.approx(0.0, abs=1e-12)
    places = np.stack([np.linspace(-0.035, 0.035, 101)] * 3, axis=-1)
    springs = spring_factor(_second("base_compliance", stiffness_over_E=30.0), places, SIZE)
    assert np.mean(springs) == pytest.approx(1.0)
    assert np.max(springs) == pytest.approx(3 * np.min(springs))


def test_families_of_fibres_have_the_stated_mean_direction():
    fibres = fibre_families(_second("anisotropy", direction=0.7, stiffness_ratio=3.0))
    assert fibres is not None and fibres.shape == (2, 3)
    mean = fibres.sum(axis=0)
    assert np.arctan2(mean[1], mean[0]) == pytest.approx(0.7)
    (alone,) = fibre_families(hide("anisotropy", direction=0.7, stiffness_ratio=3.0))  # type: ignore[misc]
    assert alone.tolist() == [np.cos(0.7), np.sin(0.7), 0.0]


def test_parabolic_front_detaches_the_same_area():
    grid = np.stack(np.meshgrid(np.linspace(-0.035, 0.035, 701), np.linspace(-0.02, 0.02, 401)), -1)
    strip, parabola = (
        ~is_bonded(law("base_detachment", edge="-x", extent=0.015), grid, SIZE)
        for law in (hide, _second)
    )
    assert parabola.mean() == pytest.approx(strip.mean(), rel=0.01)
    assert (strip != parabola).mean() > 0.02


def test_friction_laws_agree_at_the_usual_load():
    one, other = (law("base_slip", friction_coefficient=0.12) for law in (hide, _second))
    assert slip_limit(other, 2.0, 1.0) == pytest.approx(slip_limit(one, 2.0, 1.0))
    assert slip_limit(other, 4.0, 1.0) < slip_limit(one, 4.0, 1.0) == pytest.approx(0.48)
    assert slip_limit(other, -0.1, 1.0) == slip_limit(one, -0.1, 1.0) == 0.0


def test_drag_has_a_limit():
    one, other = (law("tool_friction", friction_coefficient=0.5) for law in (hide, _second))
    light, heavy = np.array([1.0]), np.array([1e7])
    assert drag_limits(other, light, 5e3) == pytest.approx(drag_limits(one, light, 5e3), rel=1e-3)
    assert drag_limits(other, heavy, 5e3) < 0.5 * 5e3 < drag_limits(one, heavy, 5e3)


def test_offset_is_as_stated_in_the_middle():
    offset = {"dx": 1e-3, "dy": 0.0, "dz": -1e-3}
    places = np.array([[0.0, 0.01, 0.04], [0.035, 0.0, 0.04]])
    middle, end = offset_at(_second("tool_offset", **offset), places, 0.07)
    assert middle == pytest.approx([1e-3, 0.0, -1e-3])
    assert end == pytest.approx([1.2e-3, 0.0, -1.2e-3])
    assert offset_at(None, places, 0.07).tolist() == [0.0, 0.0, 0.0]


def test_bending_shaft_gives_less_along_its_axis():
    axis = np.array([0.0, 0.0, -1.0])
    bending = {"compliance_times_stiffness": 30.0}
    softness = shaft_softness(_second("tool_compliance", **bending), 5e3, axis)
    assert np.diag(np.asarray(softness)) == pytest.approx([6e-3, 6e-3, 1.5e-3])
    assert shaft_softness(hide("tool_compliance", **bending), 5e3, axis) == pytest.approx(6e-3)


def test_sensors_drift_about_what_is_stated():
    instants = np.linspace(0.0, 20.0, 201)
    late = clock_offset(_second("time_offset", offset=0.1), instants, 20.0)
    assert np.mean(late) == pytest.approx(0.1)
    assert np.ptp(late) == pytest.approx(0.02)
    whole = Transform.from_vector([3e-3, 0.0, 0.0], [0.0, 0.05, 0.0])
    moved = _second("camera_registration", translation=3e-3, rotation=0.05)
    early, end = (camera_motion(moved, whole, time).translation[0] for time in (0.0, 1e4))
    assert early == pytest.approx(2.5e-3) and end == pytest.approx(3e-3)
    assert camera_motion(None, whole, 0.0) is whole
    assert depth_curvature(_second("depth_bias", offset=0.0, scale=1.04)) == pytest.approx(0.16)
    assert depth_curvature(hide("depth_bias", offset=0.0, scale=1.04)) == 0.0
