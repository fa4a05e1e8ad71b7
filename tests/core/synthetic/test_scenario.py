"""Scenarios name only what the bench can hide."""

from __future__ import annotations

import pytest

from core.errors import EffectError
from core.synthetic.scenario import HIDDEN, HiddenEffect, draw_scenario


def test_unknown_effect_names_the_known_ones() -> None:
    with pytest.raises(EffectError, match=r"cannot hide 'moon'.*stiff_inclusion"):
        HiddenEffect("moon")


def test_missing_parameter_is_named() -> None:
    with pytest.raises(EffectError, match="needs the parameters edge, extent"):
        HiddenEffect("base_detachment", {"edge": "+x"})


def test_same_seed_draws_the_same_scenario() -> None:
    assert draw_scenario(4, effects=2) == draw_scenario(4, effects=2)
    assert draw_scenario(4) != draw_scenario(5)


def test_every_effect_is_drawn_sooner_or_later() -> None:
    drawn = {hidden.effect for seed in range(80) for hidden in draw_scenario(seed).effects}
    assert drawn == set(HIDDEN)


def test_two_effects_are_different() -> None:
    for seed in range(20):
        first, second = draw_scenario(seed, effects=2).effects
        assert first.effect != second.effect


def test_fainter_effects_lie_nearer_to_neutral() -> None:
    for seed in range(30):
        (clear,), (faint,) = draw_scenario(seed).effects, draw_scenario(seed, clear=False).effects
        if clear.effect == "tool_radius":
            assert abs(faint.value("radius") - 0.005) < abs(clear.value("radius") - 0.005)
