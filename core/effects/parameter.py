"""The parameters of an effect: unit, bounds, scale, and the coordinate that a search moves."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

__all__ = ["LOG_PER_CONTRAST", "Parameter", "parameter"]

_SHORT = 1e-3
"""Distance from a bound that a search keeps, in scales [1]."""
_MATRIX = 1.5
"""Constant of the contrast (k - 1) / (k + 3/2) of a ball in an incompressible matrix [1]."""
LOG_PER_CONTRAST = 1.0 + _MATRIX
"""Change of a stiffness ratio's logarithm per change of its contrast, where the ratio is one."""


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter as fit, REST interface, slider and report use it.

    Attributes:
        name: as in reports.
        unit: in SI symbols; "1" for a pure number.
        low: lower bound.
        high: upper bound.
        scale: step that matters, for trust regions and finite differences.
        choices: allowed words, for a parameter that is not a number.
        log: whether its logarithm is searched; `scale` and `accuracy` are then of the logarithm.
        contrast: whether a stiffness ratio k is searched by its contrast (k - 1) / (k + 3/2);
            `scale` and `accuracy` are then of the contrast. A ball in an incompressible matrix
            displaces its surroundings in proportion to it (Eshelby 1957): k = 10 and k = 50 are
            close to each other, as they are in data.
        accuracy: standard deviation that the replay's own error leaves, however good the data.
            Measured against an independent solver: most likely spread of the errors beyond the
            data's own, over the cases of `benchmarks/blind/calibration-301.jsonl` and
            `benchmarks/blind/suite-1400.jsonl` (`python -m benchmarks.parameter_accuracy`).
        periodic: whether the upper bound means the same as the lower one, as for an axis.
    """

    name: str
    unit: str
    low: float = -math.inf
    high: float = math.inf
    scale: float = 1.0
    choices: tuple[str, ...] = ()
    log: bool = False
    contrast: bool = False
    accuracy: float = 0.0
    periodic: bool = False

    def coordinate(self, value: float) -> float:
        """Return the search coordinate of a value."""
        if self.contrast:
            return (value - 1.0) / (value + _MATRIX)
        return math.log(value) if self.log else value

    def value(self, coordinate: float) -> float:
        """Return the value at a search coordinate, clipped to the bounds."""
        return self.bounded(self._free(coordinate))

    def bounded(self, value: float) -> float:
        """Return the value clipped to the bounds; a periodic one is wrapped instead."""
        if self.periodic:
            return self.low + (value - self.low) % (self.high - self.low)
        return min(max(value, self.low), self.high)

    @property
    def ends(self) -> tuple[float, float]:
        """Search coordinates of the bounds; infinite for a periodic parameter."""
        return (
            (-math.inf, math.inf)
            if self.periodic
            else (self.coordinate(self.low), self.coordinate(self.high))
        )

    def interval(self, coordinate: float, width: float) -> tuple[float, float]:
        """Return the values at `coordinate` minus and plus `width`.

        An interval of a periodic parameter may pass its bounds, as -3 to 5 degrees do.
        """
        if self.periodic:
            width = min(width, (self.high - self.low) / 2)
            return self.bounded(coordinate) - width, self.bounded(coordinate) + width
        return self.value(coordinate - width), self.value(coordinate + width)

    def within(self, coordinate: float) -> float:
        """Return the value at a coordinate, at least a thousandth of a scale from the bounds."""
        (low, high), short = self.ends, _SHORT * self.scale
        return self.value(min(max(coordinate, low + short), high - short))

    def factor(self, size: float) -> float | None:
        """Return the factor by which a value of 1 grows when its coordinate changes by `size`.

        None for a parameter that is its own search coordinate.
        """
        return self._free(self.coordinate(1.0) + size) if self.log or self.contrast else None

    def _free(self, coordinate: float) -> float:
        if self.contrast:
            return (
                (1.0 + _MATRIX * coordinate) / (1.0 - coordinate) if coordinate < 1.0 else math.inf
            )
        return math.exp(min(coordinate, 700.0)) if self.log else coordinate


def parameter(
    unit: str,
    *,
    low: float = 0.0,
    high: float = 0.0,
    scale: float = 1.0,
    choices: tuple[str, ...] = (),
    log: bool = False,
    contrast: bool = False,
    accuracy: float = 0.0,
    periodic: bool = False,
) -> Any:
    """Make a dataclass field that carries a `Parameter`; the arguments are its attributes."""
    return dataclasses.field(
        metadata={
            "unit": unit,
            "low": low,
            "high": high,
            "scale": scale,
            "choices": choices,
            "log": log,
            "contrast": contrast,
            "accuracy": accuracy,
            "periodic": periodic,
        }
    )
