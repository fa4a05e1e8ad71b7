"""Scenarios name only what the bench can hide."""

from __future__ import annotations

import pytest

from palpate.effects import effect_named, from_json
from palpate.foundation.errors import EffectError
from palpate.synthetic.scenario.hidden_effects import HIDDEN, QUICK, WEIGHED, HiddenEffect
from palpate.synthetic.scenario.scenario_draws import draw_scenario


def test_unknown_effect_names_the_known_ones() -> None:
    with pytest.raises(EffectError, match=r"cannot hide 'moon'.*stiff_inclusion"):
        HiddenEffect("moon")


def test_unknown_effect_is_not_drawn() -> None:
    with pytest.raises(EffectError, match=r"cannot hide 'moon'.*tool_compliance"):
        draw_scenario(0, among=("gravity", "moon"))


def test_missing_parameter_is_named() -> None:
    with pytest.raises(EffectError, match="needs the parameters edge, extent"):
        HiddenEffect("base_detachment", {"edge": "+x"})


def test_same_seed_draws_the_same_scenario() -> None:
    assert draw_scenario(4, effects=2) == draw_scenario(4, effects=2)
    assert draw_scenario(4) != draw_scenario(5)


def test_scenarios_are_those_drawn_before_there_were_more_effects() -> None:
    first = QUICK[:9]
    assert draw_scenario(0, among=first).effects == (
        HiddenEffect("base_slip", {"friction_coefficient": 0.15}),
    )
    offset = HiddenEffect("tool_offset", {"dx": 0.00219, "dy": -0.00024, "dz": -0.0005})
    assert draw_scenario(3, effects=2, among=first).effects == (
        offset,
        HiddenEffect("gravity", {"specific_weight_over_stiffness": 2.32}),
    )
    assert draw_scenario(5, clear=False, among=first).effects == (
        HiddenEffect("base_detachment", {"edge": "-y", "extent": 0.010275}),
    )
    assert draw_scenario(11, among=first).effects == (HiddenEffect("poisson_ratio", {"nu": 0.231}),)


@pytest.mark.parametrize("among", [QUICK, WEIGHED, tuple(HIDDEN)], ids=["quick", "weighed", "all"])
def test_every_effect_is_drawn_sooner_or_later(among: tuple[str, ...]) -> None:
    drawn = {
        hidden.effect for seed in range(120) for hidden in draw_scenario(seed, among=among).effects
    }
    assert drawn == set(among)


STATED_OTHERWISE = {"camera_registration", "geometry_local"}
"""Effects whose truth is not the parameters: a pose, and a cast whose modes have coefficients."""


@pytest.mark.parametrize("effect", [effect for effect in HIDDEN if effect not in STATED_OTHERWISE])
def test_engine_knows_what_is_hidden_by_the_same_names_and_within_its_bounds(effect: str) -> None:
    units = {item.name: item.unit for item in effect_named(effect).parameters()}
    assert units == HIDDEN[effect]
    for seed in range(20):
        for clear in (True, False):
            (hidden,) = draw_scenario(seed, clear=clear, among=(effect,)).effects
            assert (
                from_json({"effect": effect, "parameters": dict(hidden.parameters)}).values()
                == hidden.parameters
            )


def test_two_effects_are_different() -> None:
    for seed in range(20):
        first, second = draw_scenario(seed, effects=2).effects
        assert first.effect != second.effect


SCALES = {"scale": 1.0, "scale_x": 1.0, "scale_y": 1.0, "scale_z": 1.0}
NEUTRAL = {"tool_radius": 0.005, "stiffness_ratio": 1.0, "nu": 0.45, "E": 5e3, **SCALES}
ENDLESS = ("J_m", "stiffness_over_E", "friction_coefficient")
AXIS = ("aside", "heading", "inclination", "bend", "sag")
PLACES = (
    *("x", "y", "z", "radius", "edge", "thickness", "direction", "pairing", "time_constant"),
    *AXIS,
)
"""Parameters that do not set the strength of an effect."""


@pytest.mark.parametrize("effect", HIDDEN)
def test_fainter_effects_lie_nearer_to_neutral(effect: str) -> None:
    for seed in range(10):
        (clear,), (faint,) = (
            draw_scenario(seed, clear=one, among=(effect,)).effects for one in (True, False)
        )
        for name in HIDDEN[effect]:
            if effect == "tool_radius" or name not in PLACES:
                far, near = (one.value(name) for one in (clear, faint))
                neutral = NEUTRAL.get("tool_radius" if effect == "tool_radius" else name, 0.0)
                endless = name in ENDLESS and effect != "tool_friction"
                assert (
                    near > far
                    if endless
                    else abs(near - neutral) < abs(far - neutral) or far == neutral
                )
