"""Models that were kept (model.json of a run), as setups again."""

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
    """The stated setup with the robot's pose, the tool's radius and Poisson's ratio of a model,
    where no cause of it sets them.
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
    """The setup of a model: its causes, and what is known only to its accuracy as it was fitted."""
    tuned = with_fitted_values(stated, model)
    found = with_effects(tuned, effects_from(model["effects"]))
    # Tuning went on from the causes, so that these values stand even where a cause sets them, too.
    return replace(
        found,
        tool=replace(found.tool, radius=float(model["setup"]["tool"]["radius"])),
        material=replace(
            found.material, poisson_ratio=float(model["setup"]["material"]["poisson_ratio"])
        ),
    )


def effects_from(rows: Sequence[Mapping[str, Any]]) -> list[Effect]:
    """Effects from plain values as `Effect.to_json` gives them; EffectError for names and values
    that are none.
    """
    found = []
    for row in rows:
        kind, given = effect_named(str(row["effect"])), dict(row["parameters"])
        wanted = {item.name: item for item in kind.parameters()}
        if set(given) != set(wanted):
            told = f"{kind.name} has the parameters {', '.join(wanted)}; given are {', '.join(map(str, given)) or 'none'}"
            raise EffectError(told, parameter=kind.name)
        for name, value in given.items():
            if not wanted[name].choices and (
                isinstance(value, bool) or not isinstance(value, (int, float))
            ):
                raise EffectError(
                    f"{kind.name}: {name} = {value!r} is no number",
                    parameter=name,
                    value=str(value),
                )
        found.append(kind(**given))
    return found
