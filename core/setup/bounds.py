"""Check of the bounds of a value of the setup."""

from __future__ import annotations

import math

from palpate.foundation.errors import SetupError

__all__ = ["require_within"]


def require_within(key: str, value: float, low: float, high: float, unit: str) -> None:
    """Raise SetupError with key, value and bounds if the value is outside them, or not finite."""
    if not (math.isfinite(value) and low <= value <= high):
        message = f"{key} = {value:g} {unit} is outside {low:g} to {high:g} {unit}"
        raise SetupError(message, key=key, value=value, low=low, high=high)
