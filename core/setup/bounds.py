"""Check of the bounds of a value of the setup."""

from __future__ import annotations

import math

from palpate.foundation.errors import SetupError

__all__ = ["MODULI", "POISSON_RATIOS", "TOOL_RADII", "require_within"]

TOOL_RADII = (1e-4, 0.2)
"""Radii that a tool can have, as stated or as found [m]."""
MODULI = (50.0, 1e9)
"""Young's moduli that a phantom can be stated to have [Pa]."""
POISSON_RATIOS = (-0.5, 0.4999)
"""Poisson's ratios that a phantom can have [1]."""


def require_within(key: str, value: float, low: float, high: float, unit: str) -> None:
    """Raise SetupError with key, value and bounds if the value is outside them, or not finite."""
    if not (math.isfinite(value) and low <= value <= high):
        message = f"{key} = {value:g} {unit} is outside {low:g} to {high:g} {unit}"
        raise SetupError(message, key=key, value=value, low=low, high=high)
