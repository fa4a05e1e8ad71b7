"""The free map of the stiffness in words."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from palpate.foundation.quantities import NARROW

__all__ = ["stiffness_sentences"]

_ENDS = {
    "-x": "the end towards -x",
    "+x": "the end towards +x",
    "-y": "the side towards -y",
    "+y": "the side towards +y",
    "+z": "the top",
}
_TIMES = 2.0
"""Ratio above which a part is said to be so many times as stiff, and not by how many percent."""


def stiffness_sentences(report: dict[str, Any]) -> list[str]:
    """Say where the body is stiffer or softer than usual, which pushes feel it, and where the data
    do not tell; nothing for a report without a map.
    """
    found = report.get("stiffness_map")
    if not found:
        return []
    gain = (
        f"{found['gain_nats']:.1f} nats over a uniform body, {found['bound_nats']:.1f} are needed"
    )
    if not found["structured"]:
        return [f"{found['why_not'].capitalize()} ({gain})."]
    parts = [_part(part) for part in found["parts"]]
    if not parts:
        parts = ["The stiffness is uneven, at no single place surely."]
    return [*parts, f"Free map of the stiffness: {gain}; {_trust(found)}."]


def _part(part: dict[str, Any]) -> str:
    """A part of the body with its ratio and interval, place, and pushes."""
    ratio, low, high = (part[name] for name in ("ratio", "low", "high"))
    if ratio > _TIMES:
        said = f"{ratio:.1f} times as stiff as the rest ({low:.1f} to {high:.1f})"
    else:
        kind = "Stiffer" if ratio >= 1.0 else "Softer"
        ends = sorted(100 * abs(end - 1.0) for end in (low, high))
        share = f"{100 * abs(ratio - 1.0):.0f}{NARROW}%"
        said = f"{kind} than the rest by {share} ({ends[0]:.0f} to {ends[1]:.0f})"
    place = ", ".join(f"{1e3 * along:.0f}" for along in part["at"])
    return f"{said} around ({place}){NARROW}mm, felt by {_counted(part['pushes'])}."


def _counted(pushes: Sequence[int]) -> str:
    """Name pushes by their numbers: push 3; pushes 3, 7 and 9."""
    if len(pushes) == 1:
        return f"push {pushes[0]}"
    return f"pushes {', '.join(map(str, pushes[:-1]))} and {pushes[-1]}"


def _trust(found: dict[str, Any]) -> str:
    """Say of how much of the surface the stiffness is told, and which ends are not."""
    told = f"told below {100 * found['trusted_share']:.0f}{NARROW}% of the surface"
    ends = [_ENDS[end] for end in found["unfelt_ends"] if end in _ENDS]
    if not ends:
        return told
    listed = ends[0] if len(ends) == 1 else f"{', '.join(ends[:-1])} and {ends[-1]}"
    return f"{told}; {listed} {'was' if len(ends) == 1 else 'were'} not felt"
