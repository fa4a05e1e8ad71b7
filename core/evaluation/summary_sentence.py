"""One sentence that says what a ladder means."""

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

_STILL = "What is as wrong in untouched frames may be the camera's, and counts only once a second model says it is not."


def summary_sentence(ladder: Mapping[str, Any]) -> str:
    """Shares of the error that can be removed, on kinds of motion that were trained on and on those
    that were not.

    Intervals stand in the ladder, beside each share.
    """
    parts = {
        part["part"]: part for part in ladder["parts"] if part["part"] in ("all", "seen", "unseen")
    }
    names = [rung["name"] for rung in ladder["rungs"] if rung["name"] in _WHO]
    if not names:
        return f"The stated model is off by {parts['all']['errors']['baseline']['error']:.2f} mm; nothing stands beside it yet."
    told = [parts[key] for key in ("seen", "unseen") if key in parts]
    alone = not any(rung["network"] is None for rung in ladder["rungs"][1:])
    error = "the error that moves with the tool" if alone else "the error that can be removed"
    first, *rest = names
    text = f"{_WHO[first]} removes {_shares(first, told)} of {error}{_where(parts)}"
    more = ", ".join(f"{_WHO[name]} {_shares(name, told)}" for name in rest)
    said = (text[0].upper() + text[1:] + (f"; {more}" if more else "")) + "."
    return f"{said} {_STILL}" if alone else said


def _shares(name: str, parts: Sequence[Mapping[str, Any]]) -> str:
    shares = [100 * part["errors"][name]["removed"]["value"] for part in parts]
    return " and ".join(f"{share:.0f} %".replace("-", "−") for share in shares)


def _where(parts: Mapping[str, Any]) -> str:
    if "seen" in parts and "unseen" in parts:
        return " on kinds of motion that training has, and on others"
    return (
        " on kinds of motion that training has"
        if "seen" in parts
        else " on kinds of motion that training never saw"
    )
