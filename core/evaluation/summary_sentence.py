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
    text = f"{_WHO[first]} {_change(first, both)}"
    if not _is_worse(first, both):
        text += f" of {kind}"
    text += _where(parts)
    more = ", ".join(f"{_WHO[name]} {_change(name, both, first)}" for name in rest)
    sentence = (text[0].upper() + text[1:] + (f"; {more}" if more else "")) + "."
    return f"{sentence} {_CAMERA_REMARK}" if alone else sentence


def _is_worse(name: str, parts: Sequence[Mapping[str, Any]]) -> bool:
    return all(part["errors"][name]["removed"]["value"] <= -0.005 for part in parts)


def _change(name: str, parts: Sequence[Mapping[str, Any]], after: str = "") -> str:
    """Share that a model removes, or from which error to which it makes the model worse.

    Args:
        name: of the model.
        parts: of the motions.
        after: model whose change stands before it in the sentence, whose verb it shares.
    """
    if _is_worse(name, parts):
        errors = [
            f"{part['errors']['baseline']['error']:.2f} to {part['errors'][name]['error']:.2f} mm"
            for part in parts
        ]
        return f"makes it worse ({' and '.join(errors)})"
    shares = " and ".join(
        f"{100 * part['errors'][name]['removed']['value']:.0f} %".replace("-", "\N{MINUS SIGN}")
        for part in parts
    )
    return shares if after and not _is_worse(after, parts) else f"removes {shares}"


def _where(parts: Mapping[str, Any]) -> str:
    if "seen" in parts and "unseen" in parts:
        return " on kinds of motion that training has, and on others"
    return (
        " on kinds of motion that training has"
        if "seen" in parts
        else " on kinds of motion that training never saw"
    )
