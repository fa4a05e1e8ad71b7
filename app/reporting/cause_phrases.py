"""Causes of a report as noun phrases."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from palpate.effects import effect_named
from palpate.foundation.errors import EffectError
from palpate.foundation.quantities import with_interval, words

__all__ = ["cause_phrase"]


def cause_phrase(cause: dict[str, Any], size: Sequence[float] | None = None) -> str:
    """One cause as a noun phrase; `size` as in `verdict_sentence`.

    A cause whose effect is not installed here, or whose parameters are not those of this version's
    effect, is named only.
    """
    values = {name: entry.get("value") for name, entry in cause.get("parameters", {}).items()}
    if "depth" in cause:
        values["depth"] = with_interval(cause["depth"])
    try:
        return effect_named(cause["effect"]).phrase(values, size)
    except (EffectError, KeyError, TypeError):
        return f"an effect called {words(cause['effect'])}"
