"""Plain values without the last digits of their numbers, for comparisons of stored setups."""

from __future__ import annotations

from typing import Any

__all__ = ["rounded"]

_DIGITS = 9
"""Decimals that are kept; lengths are in metres."""


def rounded(value: Any) -> Any:
    """Return a plain value with every number rounded to a billionth.

    A registration differs in its last digits from run to run, which makes no other setup.
    """
    if isinstance(value, float):
        return round(value, _DIGITS) + 0.0
    if isinstance(value, dict):
        return {key: rounded(one) for key, one in value.items()}
    return [rounded(one) for one in value] if isinstance(value, (list, tuple)) else value
