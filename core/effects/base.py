"""What an effect is: parameters with unit, bounds and prior, and one pure function from setup to
setup.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, Self

from palpate.foundation.errors import EffectError
from palpate.setup.setup import Setup

__all__ = ["LOG_PER_CONTRAST", "Effect", "Parameter", "Slot", "parameter", "with_effects"]

_SHORT = 1e-3
_MATRIX = 1.5
LOG_PER_CONTRAST = 1.0 + _MATRIX
"""Change of a stiffness ratio's logarithm per change of its contrast, where the ratio is one."""


class Slot(Enum):
    """The part of the experiment an effect enters; SENSOR changes only the observation, so nothing
    is solved anew.
    """

    GEOMETRY = "geometry"
    MATERIAL = "material"
    LOAD = "load"
    SUPPORT = "support"
    TOOL = "tool"
    SENSOR = "sensor"


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """What fit, REST, slider and report need to know of a parameter.

    Attributes:
        name, unit: as in effects.md, SI.
        low, high: bounds.
        scale: a step that matters, for trust regions and differences.
        choices: allowed words, for a parameter that is not a number.
        log: whether it is searched by its logarithm; then `scale` and `accuracy` are of the
            logarithm.
        contrast: whether a ratio k of stiffness is searched by (k - 1) / (k + 3/2), and `scale` and
            `accuracy` are of that: in proportion to it a ball in an incompressible matrix moves
            what surrounds it (Eshelby 1957), so that k = 10 and k = 50 are next to each other, as
            they are in data.
        accuracy: standard deviation that the replay's own error leaves, however good the data.
        periodic: whether it comes round, as an axis does: its upper bound is its lower one.
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
        """What a search moves instead of the value."""
        if self.contrast:
            return (value - 1.0) / (value + _MATRIX)
        return math.log(value) if self.log else value

    def value(self, coordinate: float) -> float:
        """The inverse of `coordinate`, brought back into the bounds."""
        return self.bounded(self._free(coordinate))

    def bounded(self, value: float) -> float:
        """The value in its bounds that is next to this one; of a periodic parameter the one that is
        the same.
        """
        if self.periodic:
            return self.low + (value - self.low) % (self.high - self.low)
        return min(max(value, self.low), self.high)

    @property
    def ends(self) -> tuple[float, float]:
        """Search coordinates of the bounds; infinite where the parameter comes round."""
        return (
            (-math.inf, math.inf)
            if self.periodic
            else (self.coordinate(self.low), self.coordinate(self.high))
        )

    def interval(self, coordinate: float, width: float) -> tuple[float, float]:
        """Values at so much to either side; of a periodic parameter they may pass its bounds, as -3
        to 5 degrees do.
        """
        if self.periodic:
            width = min(width, (self.high - self.low) / 2)
            return self.bounded(coordinate) - width, self.bounded(coordinate) + width
        return self.value(coordinate - width), self.value(coordinate + width)

    def within(self, coordinate: float) -> float:
        """The value at this coordinate, a thousandth of a scale short of the bounds at least."""
        (low, high), short = self.ends, _SHORT * self.scale
        return self.value(min(max(coordinate, low + short), high - short))

    def factor(self, size: float) -> float | None:
        """That to which one grows with a coordinate's change by `size`; None of a parameter that is
        searched as it is.
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
    """A dataclass field that carries a Parameter."""
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


@dataclass(frozen=True, kw_only=True)
class Effect(ABC):
    """One cause. A subclass is a frozen dataclass whose fields are made by `parameter`, and
    `apply`.
    """

    name: ClassVar[str]
    enters: ClassVar[Slot]
    summary: ClassVar[str]
    kinked: ClassVar[bool] = False
    """Whether something begins or ends with its numbers, as a slide does: a fit then looks beyond
    what derivatives show."""

    def __post_init__(self) -> None:
        for item in self.parameters():
            value = getattr(self, item.name)
            if item.choices:
                if value not in item.choices:
                    raise EffectError(
                        f"{self.name}: {item.name} = {value!r} is none of {', '.join(item.choices)}",
                        parameter=item.name,
                        value=value,
                    )
            elif not (math.isfinite(value) and item.low <= value <= item.high):
                raise EffectError(
                    f"{self.name}: {item.name} = {value:g} {item.unit} is outside {item.low:g} to {item.high:g} {item.unit}",
                    parameter=item.name,
                    value=value,
                    low=item.low,
                    high=item.high,
                )

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """The parameters in the order of the fields."""
        return tuple(
            Parameter(name=field.name, **field.metadata) for field in dataclasses.fields(cls)
        )

    @classmethod
    def numbers(cls) -> tuple[Parameter, ...]:
        """The parameters that are numbers, which a fit may move."""
        return tuple(item for item in cls.parameters() if not item.choices)

    @classmethod
    def at_rest(cls) -> bool:
        """Whether the rest cloud or the touches show it, so that a diagnosis asks what it changes
        there.
        """
        return cls.enters in (Slot.LOAD, Slot.GEOMETRY)

    @classmethod
    @abstractmethod
    def neutral(cls, setup: Setup) -> Self:
        """The instance that changes nothing in this setup."""

    @classmethod
    @abstractmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Finite sizes from which a search begins, spread over what is plausible for this setup."""

    @abstractmethod
    def apply(self, setup: Setup) -> Setup:
        """The setup with this cause in it."""

    def values(self) -> dict[str, float | str]:
        """Name to value, SI."""
        return {item.name: getattr(self, item.name) for item in self.parameters()}

    def reported(self, setup: Setup) -> dict[str, tuple[float | str, str]]:
        """Name to (value, unit) as a report states them of this setup; more than the fields where
        that helps the reader.
        """
        return {item.name: (getattr(self, item.name), item.unit) for item in self.parameters()}

    def moved(self, values: Sequence[float]) -> Self:
        """The same effect with other numbers, brought back into their bounds."""
        pairs = zip(self.numbers(), values, strict=True)
        return dataclasses.replace(self, **{item.name: item.bounded(float(v)) for item, v in pairs})

    @property
    def coordinates(self) -> list[float]:
        """Where a search stands: the numbers, or their logarithms."""
        return [item.coordinate(getattr(self, item.name)) for item in self.numbers()]

    def at(self, coordinates: Sequence[float]) -> Self:
        """The same effect at other search coordinates, brought back to just within the bounds.

        At a bound an effect can be absent, as a base is rigid there: what is absent has no
        first-order changes.
        """
        return self.moved(
            [item.within(float(c)) for item, c in zip(self.numbers(), coordinates, strict=True)]
        )

    def to_json(self) -> dict[str, Any]:
        """Plain values from which `palpate.effects.from_json` makes the same effect."""
        return {"effect": self.name, "parameters": self.values()}


def with_effects(setup: Setup, effects: Sequence[Effect]) -> Setup:
    """The setup with all of them in it, one after another."""
    for effect in effects:
        setup = effect.apply(setup)
    return setup
