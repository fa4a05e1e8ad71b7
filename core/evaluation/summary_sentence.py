"""A sentence that summarises an error ladder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

__all__ = ["summary_sentence"]

_WHO = {
    "baseline_network": "the network alone",
    "extended": "naming the cause alone",
    "extended_network": "both together",
    "true": "the true effects",
    "true_network": "these with a network",
}

_CAMERA_REMARK = (
    "Error that untouched frames show as well may be the camera's, and counts only once a second "
    "model shows that it is not."
)


def summary_sentence(ladder: Mapping[str, Any]) -> str:
    """Return a sentence with the share of the reducible error that each model removes.

    Shares are of kinds of motion that were trained on and of those that were not; their intervals
    are in the ladder.
    """
    parts = {
        part["part"]: part for part in ladder["parts"] if part["part"] in ("all", "seen", "unseen")
    }
    names = [rung["name"] for rung in ladder["rungs"] if rung["name"] in _WHO]
    if not names:
        error = parts["all"]["errors"]["baseline"]["error"]
        return f"The stated model is off by {error:.2f} mm; there is no other model to compare yet."
    both = [parts[key] for key in ("seen", "unseen") if key in parts]
    alone = not any(rung["network"] is None for rung in ladder["rungs"][1:])
    kind = "the error that moves with the tool" if alone else "the error that can be removed"
    first, *rest = names
    worse = all(part["errors"][first]["removed"]["value"] <= -0.005 for part in both)
    change = (
        f"adds {_shares(first, both, -1)} to" if worse else f"removes {_shares(first, both)} of"
    )
    text = f"{_WHO[first]} {change} {kind}{_where(parts)}"
    more = ", ".join(
        f"{_WHO[name]} {'removes ' if worse else ''}{_shares(name, both)}" for name in rest
    )
    sentence = (text[0].upper() + text[1:] + (f"; {more}" if more else "")) + "."
    return f"{sentence} {_CAMERA_REMARK}" if alone else sentence


def _shares(name: str, parts: Sequence[Mapping[str, Any]], sign: int = 1) -> str:
    shares = [100 * sign * part["errors"][name]["removed"]["value"] for part in parts]
    return " and ".join(f"{share:.0f} %".replace("-", "−") for share in shares)


def _where(parts: Mapping[str, Any]) -> str:
    if "seen" in parts and "unseen" in parts:
        return " on kinds of motion that training has, and on others"
    return (
        " on kinds of motion that training has"
        if "seen" in parts
        else " on kinds of motion that training never saw"
    )
