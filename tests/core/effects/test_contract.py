"""What every effect of the catalogue must keep, whoever wrote it."""

from __future__ import annotations

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from pushed_block import looking_at

from palpate.diagnosis.criteria import CRITERIA
from palpate.effects import (
    CATALOGUE,
    Effect,
    Linearisation,
    Measurement,
    Slot,
    effect_named,
    from_json,
)
from palpate.effects.elastic_material import StiffInclusion, YoungModulus, inclusion_grid
from palpate.effects.geometry import GeometryLocal
from palpate.effects.heterogeneity import Anisotropy
from palpate.effects.plugins import checked
from palpate.effects.sensor import CameraRegistration, TimeOffset
from palpate.effects.tool import ToolOffset
from palpate.foundation.errors import EffectError
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.touch_correction import touch_correction
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.protocol import Meshing
from palpate.mesh.push_meshes import SCREEN_PUSHES
from palpate.replay.replay import Equilibrium, replay
from palpate.setup.setup import Box, Setup, Tool, Touching
from palpate.synthetic.bodies.shape_families import draw_shape

SIZE = (0.0687, 0.0393, 0.0358)
CORNERS = tuple(
    (x * SIZE[0] / 2, y * SIZE[1] / 2, SIZE[2]) for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))
)
SETUP = Setup(
    geometry=Box(size=SIZE),
    tool=Tool(radius=5e-3),
    mass=0.104,
    landmarks=CORNERS,
    phantom_from_camera=looking_at(np.array([-0.19, -0.16, 0.28]), np.array([0.0, 0.0, 0.018])),
)
FREE_FORM = replace(SETUP, geometry=draw_shape("dome", 3), landmarks=(), touching=Touching())
"""For effects that no block can have."""
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)
POKE = np.array([[5e-3, 2e-3, 0.0358 + 5e-3 - depth] for depth in (1e-3, 3e-3, 5e-3)])
RELEASE = np.concatenate([POKE, POKE[:1] + np.array([0.0, 0.0, 4e-3])])
TIMES = np.arange(4) / 2

# The vocabulary: name of each effect, and name and unit of each parameter that a report states.
VOCABULARY = {
    "poisson_ratio": {"nu": "1"},
    "stiff_inclusion": {"x": "m", "y": "m", "z": "m", "radius": "m", "stiffness_ratio": "1"},
    "gravity": {"specific_weight_over_stiffness": "1/m"},
    "base_slip": {"friction_coefficient": "1"},
    "base_detachment": {"edge": "", "extent": "m"},
    "tool_radius": {"radius": "m"},
    "tool_offset": {"dx": "m", "dy": "m", "dz": "m"},
    "camera_registration": {"translation": "m", "rotation": "rad"},
    "time_offset": {"offset": "s"},
    "surface_layer": {"thickness": "m", "stiffness_ratio": "1"},
    "stiffness_gradient": {"log_ratio": "1"},
    "strain_stiffening": {"J_m": "1"},
    "anisotropy": {"direction": "rad", "stiffness_ratio": "1"},
    "viscoelasticity": {"relaxed_fraction": "1", "time_constant": "s"},
    "permanent_set": {"retained_fraction": "1"},
    "base_compliance": {"stiffness_over_E": "1/m"},
    "tool_compliance": {"compliance_times_stiffness": "1/m"},
    "tool_friction": {"friction_coefficient": "1"},
    "depth_bias": {"offset": "m", "scale": "1"},
    "geometry_scale": {"scale_x": "1", "scale_y": "1", "scale_z": "1"},
    "landmark_mismatch": {"pairing": "", "scale": "1", "inset": "m"},
    "young_modulus": {"E": "Pa"},
    "mesh_resolution": {"element_size": "m"},
    "stiff_tube": {
        **{"aside": "m", "z": "m", "heading": "rad", "inclination": "rad"},
        **{"bend": "1/m", "sag": "1/m", "radius": "m", "stiffness_ratio": "1"},
    },
    "geometry_local": {"rms": "m"},
}

# One finite size of each, for the tests that need a change.
EXAMPLES: dict[str, dict[str, float | str]] = {
    "poisson_ratio": {"nu": 0.40},
    "stiff_inclusion": {"x": 6e-3, "y": 1e-3, "z": 0.024, "radius": 6e-3, "stiffness_ratio": 4.0},
    "gravity": {"specific_weight_over_stiffness": 1.5},
    "base_slip": {"friction_coefficient": 0.1},
    "base_detachment": {"edge": "+x", "extent": 0.02},
    "tool_radius": {"radius": 4e-3},
    "tool_offset": {"dx": 1e-3, "dy": 0.0, "dz": -5e-4},
    "camera_registration": {"tx": 1e-3, "ty": 0.0, "tz": -2e-3, "rx": 0.01, "ry": 0.0, "rz": -0.02},
    "time_offset": {"offset": 0.05},
    "surface_layer": {"thickness": 3e-3, "stiffness_ratio": 4.0},
    "stiffness_gradient": {"log_ratio": 0.8},
    "strain_stiffening": {"J_m": 4.0},
    "anisotropy": {"direction": 0.4, "stiffness_ratio": 3.0},
    "viscoelasticity": {"relaxed_fraction": 0.5, "time_constant": 1.0},
    "permanent_set": {"retained_fraction": 0.3},
    "base_compliance": {"stiffness_over_E": 60.0},
    "tool_compliance": {"compliance_times_stiffness": 20.0},
    "tool_friction": {"friction_coefficient": 0.5},
    "depth_bias": {"offset": 3e-3, "scale": 1.02},
    "geometry_scale": {"scale_x": 1.03, "scale_y": 0.98, "scale_z": 1.04},
    "landmark_mismatch": {"pairing": "turn-1", "scale": 0.9, "inset": 1e-3},
    "young_modulus": {"E": 1.0e4},
    "mesh_resolution": {"element_size": 9e-3},
    "stiff_tube": {
        **{"aside": 2e-3, "z": 0.026, "heading": 0.4, "inclination": 0.1},
        **{"bend": 6.0, "sag": -3.0, "radius": 4e-3, "stiffness_ratio": 8.0},
    },
    "geometry_local": GeometryLocal.of([6e-4, -3e-4]).values(),
}
EACH = pytest.mark.parametrize("effect", CATALOGUE, ids=lambda effect: effect.name)


def _example(effect: type[Effect]) -> Effect:
    return from_json({"effect": effect.name, "parameters": EXAMPLES[effect.name]})


def _stated(*effects: type[Effect]) -> Setup:
    """A setup that can have these effects."""
    return FREE_FORM if any(effect.needs_shape for effect in effects) else SETUP


def _pushed(setup: Setup) -> tuple[np.ndarray, Meshing]:
    """A push from above, and a mesh for it."""
    if setup.geometry.is_block:
        return POKE, GRID
    top = np.array([[0.0, 0.0, setup.geometry.heights(np.zeros((1, 2)))[0]]])
    return top + np.array([0.0, 0.0, 5e-3]) - np.outer([1e-3, 3e-3, 5e-3], [0.0, 0.0, 1.0]), (
        SCREEN_PUSHES.at(top)
    )


def _setup_as_text(setup: Setup) -> str:
    return json.dumps(setup.as_dict(), sort_keys=True)


@pytest.fixture(scope="module")
def baseline() -> list[Equilibrium]:
    """A poke without any effect."""
    return replay(SETUP, POKE, GRID)


def test_catalogue_speaks_the_vocabulary():
    assert {effect.name for effect in CATALOGUE} == set(VOCABULARY)
    assert len(CATALOGUE) == len(VOCABULARY)


@EACH
def test_report_states_the_parameters_by_name_and_unit(effect):
    reported = {
        name: unit for name, (_, unit) in _example(effect).reported(_stated(effect)).items()
    }
    assert VOCABULARY[effect.name].items() <= reported.items()


@EACH
def test_parameters_have_unit_bounds_and_a_scale_within_them(effect):
    assert effect.summary and isinstance(effect.enters, Slot)
    for item in effect.parameters():
        if item.choices:
            assert item.unit == ""
            continue
        assert item.unit
        assert item.low < item.high and np.isfinite([item.low, item.high]).all()
        assert 0 < item.scale < item.coordinate(item.high) - item.coordinate(item.low)


@EACH
def test_search_coordinates_lead_back_to_the_values_and_grow_with_them(effect):
    for item in effect.numbers():
        values = np.linspace(item.low, item.high, 7)[1:-1]
        coordinates = [item.coordinate(value) for value in values]
        assert np.all(np.diff(coordinates) > 0)
        assert [item.value(coordinate) for coordinate in coordinates] == pytest.approx(
            values.tolist()
        )


def test_contrast_of_a_lump_says_how_strongly_it_acts_in_a_matrix():
    ratio = StiffInclusion.numbers()[4]
    # Eshelby: a rigid ball acts 2.5 times as strongly as a small difference in stiffness suggests,
    # a hole 5/3 of that less.
    assert ratio.coordinate(1.0) == 0.0 and ratio.coordinate(1.001) == pytest.approx(
        1e-3 / 2.5, rel=1e-3
    )
    assert ratio.coordinate(50.0) == pytest.approx(1.0, abs=0.05) and ratio.coordinate(
        0.02
    ) == pytest.approx(-2 / 3, abs=0.03)
    assert ratio.value(2.0) == ratio.high and ratio.value(-5.0) == ratio.low
    assert ratio.factor(0.4) == pytest.approx(1.6 / 0.6) and ratio.factor(1.0) == np.inf


def test_direction_has_no_end():
    turn, _ = Anisotropy.numbers()
    assert turn.value(-0.1) == pytest.approx(np.pi - 0.1) and turn.value(
        np.pi + 0.1
    ) == pytest.approx(0.1)
    assert turn.ends == (-np.inf, np.inf) and turn.within(0.0) == 0.0
    assert turn.interval(0.02, 0.05) == pytest.approx((-0.03, 0.07))
    assert turn.interval(np.pi + 0.02, 9.0) == pytest.approx((0.02 - np.pi / 2, 0.02 + np.pi / 2))
    fibres = Anisotropy(direction=0.05, stiffness_ratio=3.0)
    assert (
        fibres.at([-0.1, 1.0]).direction
        == fibres.moved([-0.1, 3.0]).direction
        == pytest.approx(np.pi - 0.1)
    )


@EACH
def test_neutral_changes_nothing_in_a_replay(effect, baseline):
    setup = effect.neutral(SETUP).apply(SETUP)
    for frame, wanted in zip(replay(setup, POKE, GRID, times=TIMES[:3]), baseline, strict=True):
        assert np.allclose(frame.displacement, wanted.displacement, atol=1e-9)
        assert np.allclose(frame.slip, wanted.slip) and np.allclose(
            frame.force, wanted.force, rtol=1e-6, atol=1e-9
        )
    assert setup.sensor.time_offset == SETUP.sensor.time_offset
    assert camera_model_for(setup).same(camera_model_for(SETUP)) and np.array_equal(
        touch_correction(setup, GRID).matrix, np.eye(4)
    )


@EACH
def test_example_changes_replay_or_sensor(effect):
    side = np.array([[0.0343 + 5e-3 - depth, 0.0, 0.02] for depth in (2e-3, 6e-3)])  # slides a base
    stated = _stated(effect)
    setup = _example(effect).apply(stated)
    if effect.enters is Slot.SENSOR:
        assert _setup_as_text(replace(setup, sensor=SETUP.sensor)) == _setup_as_text(SETUP)
        assert _setup_as_text(setup) != _setup_as_text(SETUP)
        assert effect is TimeOffset or not camera_model_for(setup).same(camera_model_for(SETUP))
        return
    poke, grid = _pushed(stated)
    way = side if effect.enters is Slot.SUPPORT else RELEASE if setup.material.has_history else poke
    found, without = (
        replay(one, touch_correction(one, grid).apply(way), grid, times=TIMES[: len(way)])[-1]
        for one in (setup, stated)
    )
    point = np.array([[3e-3, 1e-3, stated.geometry.height]])
    moved = np.linalg.norm(found.move(point * setup.scale) - without.move(point))
    if effect is YoungModulus:  # the shape is that of any other stiffness, and the force is not
        assert moved < 1e-9 and np.allclose(found.force, 2 * without.force, rtol=1e-9)
    else:
        assert moved > 2e-5


@EACH
def test_json_gives_the_same_effect_back(effect):
    for one in (_example(effect), effect.neutral(SETUP)):
        assert from_json(json.loads(json.dumps(one.to_json()))) == one


@EACH
def test_value_out_of_bounds_is_an_error_that_names_everything(effect):
    values = EXAMPLES[effect.name]
    for item in effect.parameters():
        wrong = "up" if item.choices else item.high + 1
        with pytest.raises(EffectError) as caught:
            from_json({"effect": effect.name, "parameters": {**values, item.name: wrong}})
        told = [
            effect.name,
            item.name,
            *(item.choices or (f"{item.high + 1:g}", f"{item.low:g}", f"{item.high:g}", item.unit)),
        ]
        assert all(part in caught.value.message for part in told), caught.value.message
        assert caught.value.where["parameter"] == item.name and caught.value.where["value"] == wrong
    for item in effect.numbers():
        with pytest.raises(EffectError, match=item.name):
            from_json({"effect": effect.name, "parameters": {**values, item.name: float("nan")}})


@EACH
def test_apply_leaves_the_setup_alone_and_repeats_itself(effect):
    stated = _stated(effect)
    before = _setup_as_text(stated)
    first, second = (_setup_as_text(_example(effect).apply(stated)) for _ in range(2))
    assert _setup_as_text(stated) == before and first == second != before


@EACH
def test_effect_composes_with_every_other(effect):
    for other in CATALOGUE:
        if other is effect:
            continue
        stated = _stated(effect, other)
        both = _setup_as_text(_example(effect).apply(_example(other).apply(stated)))
        turned = _setup_as_text(_example(other).apply(_example(effect).apply(stated)))
        assert both == turned
        assert both not in (_setup_as_text(_example(one).apply(stated)) for one in (effect, other))


@EACH
def test_starts_lie_within_bounds_and_change_the_setup(effect):
    stated = _stated(effect)
    starts = effect.starts(stated)
    assert starts
    for start in starts:
        assert from_json(start.to_json()) == start
    if effect not in (ToolOffset, CameraRegistration):  # these are linear enough to begin at zero
        plain = _setup_as_text(stated)
        assert all(_setup_as_text(start.apply(stated)) != plain for start in starts)


@EACH
def test_moved_keeps_words_and_stays_within_bounds(effect):
    example = _example(effect)
    far = example.moved([item.high + 1 for item in effect.numbers()])
    assert [getattr(far, item.name) for item in effect.numbers()] == [
        item.low + 1 if item.periodic else item.high for item in effect.numbers()
    ]
    assert all(
        getattr(far, item.name) == getattr(example, item.name)
        for item in effect.parameters()
        if item.choices
    )


def _kinds(setup: Setup) -> tuple[bool, ...]:
    """What a setup has or has not, and no small change gives or takes."""
    support, material = setup.support, setup.material
    moves = bool(support.detached) or support.stiffness_over_E is not None
    return (
        moves,
        support.friction_coefficient is not None,
        setup.has_history,
        material.fibres is not None,
    )


@EACH
def test_small_step_from_the_end_of_what_a_search_reaches_gives_and_takes_nothing(effect):
    """A search that stepped to the bound where a base is rigid had no first-order changes there,
    and broke off.
    """
    start = effect.starts(SETUP)[0]
    for number, item in enumerate(effect.numbers()):
        for far, back in ((item.low, 1.0), (item.high, -1.0)):
            coordinates = start.coordinates
            coordinates[number] = item.coordinate(far)
            end = start.at(coordinates)
            beside = end.coordinates
            beside[number] += back * CRITERIA.derivatives.step * item.scale
            changed = (one.apply(_stated(effect)) for one in (end, end.at(beside)))
            assert len({_kinds(one) for one in changed}) == 1, item.name


def test_unknown_effect_is_an_error_that_lists_the_known():
    with pytest.raises(
        EffectError, match=r"no effect is called 'magic'.*poisson_ratio.*camera_registration"
    ):
        effect_named("magic")


@EACH
def test_linearisation_of_an_effect_does_not_contradict_itself(effect):
    others = {kind.name for kind in CATALOGUE} - {effect.name}
    assert checked(effect, others) is effect if effect.enters is not Slot.GEOMETRY else True
    assert effect.shown_by <= set(Measurement) and effect.shown_by
    assert set(effect.told_apart_by) <= others and all(effect.told_apart_by.values())


@EACH
def test_tangents_change_nothing_but_one_number_or_are_a_whole_change(effect):
    if effect.linearisation is not Linearisation.TANGENT:
        return
    names = [item.name for item in effect.numbers()]
    for tangent in effect.tangents(SETUP):
        assert isinstance(tangent.effect, effect) and tangent.of in ("", *names)
        unchanged = _setup_as_text(tangent.effect.apply(SETUP)) == _setup_as_text(SETUP)
        assert unchanged == bool(tangent.of)
    if effect.joint:
        assert [tangent.of for tangent in effect.tangents(SETUP)] == names


@EACH
def test_first_guess_follows_the_linear_fit_and_stays_within_the_bounds(effect):
    start = effect.starts(SETUP)[0]
    for change in (-1e3, -0.1, 0.1, 1e3):
        guess = start.initial_guess({item.name: change * item.scale for item in effect.numbers()})
        assert type(guess) is effect
    if effect.linearisation in (Linearisation.NUISANCE, Linearisation.LOCAL_STIFFNESS):
        item = effect.numbers()[-1]
        neutral = effect.neutral(SETUP)
        guess = neutral.initial_guess({item.name: item.scale})
        assert guess.coordinates[-1] == pytest.approx(neutral.coordinates[-1] + item.scale)
    assert type(start.scaled(0.5)) is effect


def test_softer_along_one_direction_is_stiffer_across_it():
    fibres = Anisotropy(direction=0.2, stiffness_ratio=1.0)
    softer = fibres.initial_guess({"stiffness_ratio": -0.5})
    assert softer.direction == pytest.approx(0.2 + np.pi / 2)
    assert softer.stiffness_ratio == pytest.approx(np.exp(0.5))


def test_an_inclusion_is_placed_where_the_grid_has_it():
    for place in inclusion_grid(SETUP):
        effect = StiffInclusion.placed(place)
        assert effect.inclusion == replace(place, stiffness_ratio=1.0)
    with pytest.raises(EffectError, match="has no place"):
        ToolOffset.placed(place)


def test_families_have_at_least_two_members():
    found: dict[str, int] = {}
    for effect in CATALOGUE:
        if effect.family is not None:
            found[effect.family.name] = found.get(effect.family.name, 0) + 1
    assert set(found) == {"memory", "tool", "camera", "stiffness", "base"}
    assert min(found.values()) >= 2


def test_direction_is_said_to_the_degree() -> None:
    said = Anisotropy.phrase({"stiffness_ratio": 2.8, "direction": math.radians(106.9)})
    assert said.endswith("2.8 times as stiff along one direction as across, 107° from the x axis")
