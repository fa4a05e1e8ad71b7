"""What a sweep moves: parameters of effects. The setup's own have their names, too:
`poisson_ratio.nu`, `tool_radius.radius`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from palpate.effects import Effect, Parameter, effect_named
from palpate.foundation.errors import EffectError
from palpate.setup.setup import Setup

__all__ = ["Axis", "ParameterSpace", "Values"]

Values = Mapping[str, float | str]


def _parameter(name: str) -> tuple[type[Effect], Parameter]:
    """The effect and the parameter of `effect.parameter`; EffectError where there is none."""
    cause, _, key = name.partition(".")
    effect = effect_named(cause)
    for item in effect.parameters():
        if item.name == key:
            return effect, item
    known = ", ".join(f"{cause}.{item.name}" for item in effect.parameters())
    raise EffectError(f"{cause} has no parameter {key!r}; it has {known}", parameter=name)


@dataclass(frozen=True)
class Axis:
    """One parameter that is swept from `low` to `high` (SI), by `effect.parameter`; the catalogue's
    bounds hold.
    """

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        item = self.parameter
        if item.choices:
            raise EffectError(
                f"{self.name} is a word, which cannot be swept; fix it to one of {', '.join(item.choices)}",
                parameter=self.name,
            )
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise EffectError(
                f"{self.name}: {self.low:g} to {self.high:g} is no range; give the lower bound first",
                parameter=self.name,
            )
        if self.low < item.low or self.high > item.high:
            raise EffectError(
                f"{self.name}: {self.low:g} to {self.high:g} {item.unit} leaves {item.low:g} to {item.high:g} {item.unit}",
                parameter=self.name,
                low=item.low,
                high=item.high,
            )

    @property
    def parameter(self) -> Parameter:
        """As the catalogue has it."""
        return _parameter(self.name)[1]

    @property
    def ends(self) -> tuple[float, float]:
        """The bounds as search coordinates (`Parameter.coordinate`)."""
        return self.parameter.coordinate(self.low), self.parameter.coordinate(self.high)

    def value(self, coordinate: float) -> float:
        """Of a search coordinate, inside the bounds."""
        return float(min(max(self.parameter.value(coordinate), self.low), self.high))

    def line(self, count: int) -> list[float]:
        """Values evenly spread over the bounds in the search coordinate; both ends are among
        them."""
        return [self.value(float(place)) for place in np.linspace(*self.ends, count)]


@dataclass(frozen=True)
class ParameterSpace:
    """The axes of a sweep, and parameters of effects that are held at other values than the setup's
    own.
    """

    axes: tuple[Axis, ...]
    fixed: Values = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [axis.name for axis in self.axes]
        if not names:
            raise EffectError("nothing is swept; name a parameter, such as poisson_ratio.nu")
        for name in (*names, *self.fixed):
            if names.count(name) + (name in self.fixed) > 1:
                raise EffectError(
                    f"{name} is named twice; name each parameter once", parameter=name
                )
        for name in self.fixed:
            _parameter(name)

    def setup(self, stated: Setup, values: Values) -> Setup:
        """The stated setup with these values of the axes in it; what an effect leaves unnamed is
        what the setup has.
        """
        wanted: dict[str, dict[str, Any]] = {}
        for name, value in {**self.fixed, **values}.items():
            cause, _, key = name.partition(".")
            wanted.setdefault(cause, {})[key] = value
        for cause, parameters in wanted.items():
            stated = replace(effect_named(cause).neutral(stated), **parameters).apply(stated)
        return stated
