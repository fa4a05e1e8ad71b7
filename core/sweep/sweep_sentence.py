"""One sentence that says what a sweep shows, and nothing that its pushes do not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from palpate.effects import effect_named
from palpate.foundation.quantities import NARROW, SHOWN, quantity, words

__all__ = ["sweep_sentence"]

_PLATEAU = 0.5
"""Share of the range from which the interval of the least error's place is a plateau [1]."""
_MORE = "Other causes may lower the error as much: a diagnosis compares them."


def sweep_sentence(summary: Mapping[str, Any]) -> str:
    """Return what a sweep shows: where the error is least, to what, and what stays open.

    A parameter along which the error is flat has no value in it, and a gain that resampled pushes
    do not show is no gain.
    """
    best, stated = summary["best"], summary["stated"]
    if best is None:
        return "No point has an error."
    directions = summary["directions"]
    open_ones = [one for one in directions if one["flat"] is not False or one["little"]]
    telling = [one for one in directions if one not in open_ones]
    error = _error(best["error"])
    if not telling:
        names = " or ".join(_label(one["name"]) for one in directions) or "these parameters"
        reach = max((one["change"] for one in directions), default=0.0)
        alone = any(one["flat"] is None for one in directions)
        why = " from one push" if alone else ""
        return (
            f"These clouds cannot tell {names}{why}: over the whole range the error changes by "
            f"{_error(reach)}, from {error}."
        )
    places = "; ".join(_place(one, summary) for one in telling)
    text = f"Least error {error} at {places}{_against(summary, stated)}."
    if open_ones:
        names = ", ".join(_label(one["name"]) for one in open_ones)
        text += f" These clouds cannot tell {names}."
    if edges := [_label(one["name"]) for one in telling if one["edge"]]:
        text += f" The least lies at the edge of the range of {', '.join(edges)}: widen it."
    return f"{text} {_MORE}" if _gains(summary) else text


def _gains(summary: Mapping[str, Any]) -> bool:
    gain = summary.get("gain")
    return gain is not None and bool(gain["low"] > 0)


def _against(summary: Mapping[str, Any], stated: float | None) -> str:
    if stated is None:
        return ""
    if _gains(summary):
        return f"; {_error(stated)} as stated"
    return f"; as stated {_error(stated)}, which drawing the pushes anew does not tell apart"


def _place(one: Mapping[str, Any], summary: Mapping[str, Any]) -> str:
    unit = _unit(one["name"])
    best = quantity(summary["best"]["values"][one["name"]], unit, 3)
    if one["least"] is None:
        return f"{_label(one['name'])} {best}"
    low, high = one["least"]
    span = max(one["values"]) - min(one["values"])
    ends = f"{_bare(low, unit)} to {_bare(high, unit)}"
    if high - low > _PLATEAU * span:
        return f"{_label(one['name'])} anywhere from {ends}{NARROW}{_shown(unit)}".rstrip(NARROW)
    return f"{_label(one['name'])} {best} ({ends})"


def _label(name: str) -> str:
    cause, _, key = name.partition(".")
    if len(effect_named(cause).parameters()) == 1:
        return words(cause)
    return f"{words(cause)} {words(key)}"


def _unit(name: str) -> str:
    cause, _, key = name.partition(".")
    return next((one.unit for one in effect_named(cause).parameters() if one.name == key), "1")


def _bare(value: float, unit: str) -> str:
    factor, _ = SHOWN.get(unit, (1.0, unit))
    return f"{value * factor:.3g}"


def _shown(unit: str) -> str:
    return SHOWN.get(unit, (1.0, unit))[1]


def _error(metres: float) -> str:
    """An error [m] in mm with three digits, and nothing finer than 0.001 mm."""
    return f"{max(1e3 * metres, 0.001):.3g}{NARROW}mm" if metres else f"0{NARROW}mm"
