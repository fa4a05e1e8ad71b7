"""How large a hidden effect is in units of what the experiment could just tell, by the report's own map."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from core.effects import Effect, effect_named
from core.errors import EffectError
from core.frames import Transform
from core.setup import Box, Material, Setup, Tool

if TYPE_CHECKING:
    from core.synthetic import HiddenEffect, Scenario

__all__ = ["camera_pose", "size_over_limit"]

_PROPORTIONAL = (
    "specific_weight_over_stiffness",
    "compliance_times_stiffness",
    "log_ratio",
    "relaxed_fraction",
    "retained_fraction",
)
"""Parameters in proportion to which the surface moves, so that a share of what one size does is that share of the size."""
_INVERSE = ("J_m", "stiffness_over_E")
"""The same of their inverse: they are nothing where they are infinite."""
_BESIDE = ("time_constant",)
"""Parameters that say when something shows and not how strongly: a limit is stated at one of them."""


def size_over_limit(
    hidden: Sequence[HiddenEffect], told: Sequence[Mapping[str, Any]], scenario: Scenario, camera_shift: Transform
) -> float | None:
    """Size of the one hidden effect over its detection limit [1].

    Of several parameters the root of the squares' sum: each alone gains the bound at its limit, and gains grow with the square.
    A lump's limit is that of the nearest place that was screened; of other candidates, such as edges of a base, the one that half
    of them reach.

    Args:
        told: the report's ambiguity map. camera_shift: as the truth has it, phantom frame.

    Returns:
        None where nothing or more than one effect is hidden, where a word of it (a pairing, an edge) is not the believed one, which
        has no size, or where the map gives no limit in terms of its parameters.
    """
    row = next((row for row in told if len(hidden) == 1 and row["effect"] == hidden[0].effect), None)
    if row is None:
        return None
    try:
        effect = effect_named(hidden[0].effect)
    except EffectError:
        return None
    true, neutral = _true_values(hidden[0], scenario, camera_shift), effect.neutral(_believed(scenario)).values()
    if any(isinstance(value, str) and value != neutral[name] for name, value in hidden[0].parameters.items()):
        return None
    first, at = _nearest(row, hidden[0])
    parts = [_part(limit, at, effect, true, neutral) for limit in [first, *row["limits"][1:]]]
    known = [part for part in parts if part is not None]
    return round(math.hypot(*known), 3) if len(known) == len(parts) else None


def camera_pose(shift: Transform, size: Sequence[float]) -> dict[str, float]:
    """A camera's shift in the phantom frame as the motion about the middle of a block of this size [m] that a diagnosis fits.

    A turn about the base's centre moves the middle, too: by half a millimetre where it is 0.03.
    """
    middle = np.array([0.0, 0.0, size[2] / 2])
    step = shift.apply(middle) - middle
    return dict(zip(("tx", "ty", "tz", "rx", "ry", "rz"), [*step.tolist(), *shift.rotation_vector.tolist()], strict=True))


def _nearest(row: Mapping[str, Any], hidden: HiddenEffect) -> tuple[Mapping[str, Any], Mapping[str, Any]]:
    """The first limit of the place that is nearest to what is hidden, and the fixed parameters there."""

    def far(at: Mapping[str, Any]) -> float:
        return math.dist([at[name]["value"] for name in "xyz"], [hidden.value(name) for name in "xyz"])

    each = [one for one in row.get("each", []) if "x" in one["at"]]
    best = min(each, key=lambda one: far(one["at"]), default={"limit": row["typical"], "at": row["at"]})
    return best["limit"], best["at"]


def _part(
    limit: Mapping[str, Any],
    at: Mapping[str, Any],
    effect: type[Effect],
    true: Mapping[str, float],
    neutral: Mapping[str, float | str],
) -> float | None:
    if "share" in limit:
        strengths = [name for name in at if name not in _BESIDE]
        name = strengths[0] if len(strengths) == 1 else ""
        if name not in (*_PROPORTIONAL, *_INVERSE) or limit["share"] is None:
            return None
        if name in _INVERSE:
            return float(at[name]["value"] / true[name]) / float(limit["share"])
        here, there = true[name] - float(neutral[name]), at[name]["value"] - float(neutral[name])
        return float(abs(here / there)) / float(limit["share"])
    item = next(item for item in effect.numbers() if item.name == limit["parameter"])
    far = abs(item.coordinate(true[item.name]) - item.coordinate(float(neutral[item.name])))
    least = limit["factor"] if "factor" in limit else limit["change"]
    if least is None:
        return 0.0
    return float(far / (math.log(least) if "factor" in limit else least))


def _believed(scenario: Scenario) -> Setup:
    material = Material(young_modulus=scenario.young_modulus, poisson_ratio=scenario.poisson_ratio)
    return Setup(geometry=Box(size=scenario.size), tool=Tool(radius=scenario.tool_radius), material=material, mass=scenario.mass)


def _true_values(hidden: HiddenEffect, scenario: Scenario, camera_shift: Transform) -> dict[str, float]:
    """Numbers of the truth by the names of the parameters that are fitted."""
    if hidden.effect == "camera_registration":
        return camera_pose(camera_shift, scenario.size)
    return {name: float(value) for name, value in hidden.parameters.items() if not isinstance(value, str)}
