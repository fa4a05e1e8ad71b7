"""Size of a hidden effect over its detection limit, by the report's ambiguity map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.effects import Effect, effect_named
from palpate.foundation.errors import EffectError
from palpate.foundation.frames import Transform
from palpate.setup.setup import Box, Material, Setup, Tool

if TYPE_CHECKING:
    from palpate.synthetic import HiddenEffect, Scenario

__all__ = ["camera_pose", "size_over_limit"]

_PROPORTIONAL = (
    "specific_weight_over_stiffness",
    "compliance_times_stiffness",
    "log_ratio",
    "relaxed_fraction",
    "retained_fraction",
)
"""Parameters to which the surface's displacement is proportional."""
_INVERSE = ("J_m", "stiffness_over_E")
"""Parameters to whose inverse the surface's displacement is proportional."""
_POWERS = {"extent": 5 / 3}
"""Exponents of other parameters in the surface's displacement [1]. Measured: replays of a block
pushed at four places, with a strip of 1/10 to 9/20 of its length detached along one edge, follow
exponents of 1.5 to 1.8."""
_TUBE, _REACH = ("aside", "z", "heading"), 2e-2
"""Parameters that place a level tube, and length of it that pushes feel to either side [m]."""
_BESIDE = ("time_constant",)
"""Parameters that do not set the strength of an effect; a limit is stated at one value of them."""


def size_over_limit(
    hidden: Sequence[HiddenEffect],
    ambiguity_map: Sequence[Mapping[str, Any]],
    scenario: Scenario,
    camera_shift: Transform,
) -> float | None:
    """Size of the hidden effect over its detection limit [1], of two effects the smaller one.

    Sizes of several parameters are added in squares: each alone gains the bound at its limit, and
    gains grow with the square. The limit of a lump is that of the nearest screened place and its
    radius, and a lump acts in proportion to its volume (Eshelby 1957), a tube to its cross-section.
    The limit of a detached strip is that of its edge. The limit of other candidates is the one that
    half of them reach.

    Args:
        hidden: effects.
        ambiguity_map: of the report.
        scenario: with the beliefs.
        camera_shift: true one, phantom frame.

    Returns:
        None where nothing is hidden, where a hidden word (a pairing) differs from the believed one
        and has no size, or where the map has no limit for its parameters.
    """
    sizes = [_size(one, ambiguity_map, scenario, camera_shift) for one in hidden]
    known = [size for size in sizes if size is not None]
    return min(known) if known and len(known) == len(sizes) else None


def _size(
    hidden: HiddenEffect,
    ambiguity_map: Sequence[Mapping[str, Any]],
    scenario: Scenario,
    camera_shift: Transform,
) -> float | None:
    row = next((row for row in ambiguity_map if row["effect"] == hidden.effect), None)
    if row is None:
        return None
    try:
        effect = effect_named(hidden.effect)
    except EffectError:
        return None
    true, neutral = (
        _true_values(hidden, scenario, camera_shift),
        effect.neutral(_believed(scenario)).values(),
    )
    if any(
        isinstance(value, str) and name != "edge" and value != neutral[name]
        for name, value in hidden.parameters.items()
    ):
        return None
    first, at = _nearest(row, hidden)
    parts = [_part(limit, at, effect, true, neutral) for limit in [first, *row["limits"][1:]]]
    known = [part for part in parts if part is not None]
    return round(math.hypot(*known), 3) if len(known) == len(parts) else None


def camera_pose(shift: Transform, size: Sequence[float]) -> dict[str, float]:
    """Parameters of a camera's shift as a diagnosis fits them: translation [m] of the middle of a
    block of this size [m], and rotation vector [rad].

    A rotation about the base's centre moves the middle, too: 0.03 rad by half a millimetre.
    """
    middle = np.array([0.0, 0.0, size[2] / 2])
    step = shift.apply(middle) - middle
    return dict(
        zip(
            ("tx", "ty", "tz", "rx", "ry", "rz"),
            [*step.tolist(), *shift.rotation_vector.tolist()],
            strict=True,
        )
    )


def _nearest(
    row: Mapping[str, Any], hidden: HiddenEffect
) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """First limit of the place or edge nearest to the hidden one, and its fixed parameters."""

    def far(at: Mapping[str, Any]) -> float:
        if "edge" in at:
            return float(at["edge"]["value"] != hidden.parameters["edge"])
        if "aside" in at:
            return _apart({name: at[name]["value"] for name in _TUBE}, hidden)
        return math.dist(
            [at[name]["value"] for name in "xyz"], [hidden.value(name) for name in "xyz"]
        )

    each = [one for one in row.get("each", []) if {"x", "edge", "aside"} & set(one["at"])]
    best = min(
        each, key=lambda one: far(one["at"]), default={"limit": row["typical"], "at": row["at"]}
    )
    return best["limit"], best["at"]


def _apart(screened: Mapping[str, float], hidden: HiddenEffect) -> float:
    """Distance of a screened level tube from a hidden one [m], which is the same from either end:
    that of their middles, and that of their ends `_REACH` away by their headings.
    """
    turn = hidden.value("heading") - screened["heading"]
    aside = hidden.value("aside") * (1.0 if math.cos(turn) >= 0 else -1.0)
    return math.hypot(
        aside - screened["aside"], hidden.value("z") - screened["z"], _REACH * math.sin(turn)
    )


def _part(
    limit: Mapping[str, Any],
    at: Mapping[str, Any],
    effect: type[Effect],
    true: Mapping[str, float],
    neutral: Mapping[str, float | str],
) -> float | None:
    if "share" in limit:
        strengths = [name for name in at if name not in (*_BESIDE, "edge")]
        name = strengths[0] if len(strengths) == 1 else ""
        if name not in (*_PROPORTIONAL, *_INVERSE, *_POWERS) or limit["share"] is None:
            return None
        if name in _INVERSE:
            return float(at[name]["value"] / true[name]) / float(limit["share"])
        here, there = true[name] - float(neutral[name]), at[name]["value"] - float(neutral[name])
        return float(abs(here / there) ** _POWERS.get(name, 1.0)) / float(limit["share"])
    item = next(item for item in effect.numbers() if item.name == limit["parameter"])
    far = abs(item.coordinate(true[item.name]) - item.coordinate(float(neutral[item.name])))
    least = limit["factor"] if "factor" in limit else limit["change"]
    if least is None:
        return 0.0
    grows = 2 if "aside" in at else 3
    volume = (true["radius"] / at["radius"]["value"]) ** grows if "radius" in at else 1.0
    return float(
        volume
        * far
        / (item.coordinate(least) - item.coordinate(1.0) if "factor" in limit else least)
    )


def _believed(scenario: Scenario) -> Setup:
    material = Material(young_modulus=scenario.young_modulus, poisson_ratio=scenario.poisson_ratio)
    return Setup(
        geometry=Box(size=scenario.size),
        tool=Tool(radius=scenario.tool_radius),
        material=material,
        mass=scenario.mass,
    )


def _true_values(
    hidden: HiddenEffect, scenario: Scenario, camera_shift: Transform
) -> dict[str, float]:
    """True numbers by the names of the fitted parameters."""
    if hidden.effect == "camera_registration":
        return camera_pose(camera_shift, scenario.size)
    return {
        name: float(value)
        for name, value in hidden.parameters.items()
        if not isinstance(value, str)
    }
