"""Dataclass fields that state the unit, the meaning and the source of their value."""

from __future__ import annotations

from dataclasses import field
from typing import TypeVar

__all__ = ["CHOSEN", "threshold"]

CHOSEN = "chosen, not derived"
"""Source of a value for which no measurement, derivation or reference is known."""

T = TypeVar("T")


def threshold(value: T, unit: str, meaning: str, source: str = CHOSEN) -> T:
    """Make a dataclass field with this default.

    Args:
        value: the default.
        unit: in SI symbols; "1" for a plain number.
        meaning: one or two sentences.
        source: begins with "measured:", "derived:" or "reference:", or is `CHOSEN`.
    """
    return field(default=value, metadata={"unit": unit, "meaning": meaning, "source": source})
