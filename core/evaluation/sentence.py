"""One sentence that says what a ladder means."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["meaning", "percent"]

_KINDS = {"top": "pushes from above", "side": "pushes into a side", "drag": "drags"}


def percent(share: Mapping[str, float]) -> str:
    """A share with its interval: 42 % (37 to 46 %)."""
    return f"{100 * share['value']:.0f} % ({100 * share['low']:.0f} to {100 * share['high']:.0f} %)"


def meaning(ladder: Mapping[str, Any]) -> str:
    """What is gone of the error that can be removed, on kinds of motion that were trained on and on those that were not."""
    parts = {part["part"]: part for part in ladder["parts"] if part["part"] in ("all", "seen", "unseen")}
    names = [rung["name"] for rung in ladder["rungs"]]
    if len(names) < 2:
        return f"The stated model is off by {parts['all']['errors']['baseline']['error']:.2f} mm; nothing stands beside it yet."
    told = []
    for key in ("seen", "unseen"):
        if key in parts:
            told.append(f"on {_where(key, parts[key], ladder['trained_kinds'])} {_gained(parts[key], names)}")
    text = "; ".join(told) if told else _gained(parts["all"], names)
    return f"Of the error that can be removed, {text}."


def _where(key: str, part: Mapping[str, Any], trained: list[str]) -> str:
    kinds = " and ".join(_KINDS.get(kind, kind) for kind in part["kinds"])
    return f"{kinds}, which training has," if key == "seen" else f"{kinds}, which training never saw,"


def _gained(part: Mapping[str, Any], names: list[str]) -> str:
    said = {
        "baseline_network": "the network alone removes {}",
        "extended": "naming the cause alone {}",
        "extended_network": "both {}",
        "true": "the true effects {}",
        "true_network": "the true effects with a network {}",
    }
    told = [said[name].format(percent(part["errors"][name]["removed"])) for name in names if name in said]
    return ", ".join(told)
