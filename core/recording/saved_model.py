"""Setups of stored models (model.json of a run)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from palpate.effects import Effect, effect_named
from palpate.effects.base import with_effects
from palpate.foundation.errors import EffectError
from palpate.foundation.frames import Transform
from palpate.setup.setup import Setup

__all__ = ["effects_from", "setup_of_model", "with_fitted_values"]


def with_fitted_values(stated: Setup, model: Mapping[str, Any]) -> Setup:
    """The stated setup with a model's robot pose, tool radius and Poisson's ratio.

    Radius and ratio stay as stated if one of the model's causes sets them.
    """
    pose = Transform.from_matrix(np.array(model["setup"]["phantom_from_robot"]))
    named = {one["effect"] for one in model["effects"]}
    radius = (
        stated.tool.radius if "tool_radius" in named else float(model["setup"]["tool"]["radius"])
    )
    nu = (
        stated.material.poisson_ratio
        if "poisson_ratio" in named
        else float(model["setup"]["material"]["poisson_ratio"])
    )
    return replace(
        stated,
        phantom_from_robot=pose,
        tool=replace(stated.tool, radius=radius),
        material=replace(stated.material, poisson_ratio=nu),
    )


def setup_of_model(stated: Setup, model: Mapping[str, Any]) -> Setup:
    """The setup of a model: its causes, and its fitted values of quantities known only to their
    accuracy.
    """
    tuned = with_fitted_values(stated, model)
    setup = with_effects(tuned, effects_from(model["effects"]))
    # These values were fitted after the causes, so they hold even if a cause sets them, too.
    return replace(
        setup,
        tool=replace(setup.tool, radius=float(model["setup"]["tool"]["radius"])),
        material=replace(
            setup.material, poisson_ratio=float(model["setup"]["material"]["poisson_ratio"])
        ),
    )


def effects_from(rows: Sequence[Mapping[str, Any]]) -> list[Effect]:
    """Make effects from plain values as of `Effect.to_json`; EffectError for unknown names and
    values.
    """
    effects = []
    for row in rows:
        kind, given = effect_named(str(row["effect"])), dict(row["parameters"])
        expected = {item.name: item for item in kind.parameters()}
        if set(given) != set(expected):
            message = (
                f"{kind.name} has the parameters {', '.join(expected)}; "
                f"given are {', '.join(map(str, given)) or 'none'}"
            )
            raise EffectError(message, parameter=kind.name)
        for name, value in given.items():
            if not expected[name].choices and (
                isinstance(value, bool) or not isinstance(value, (int, float))
            ):
                raise EffectError(
                    f"{kind.name}: {name} = {value!r} is no number",
                    parameter=name,
                    value=str(value),
                )
        effects.append(kind(**given))
    return effects
