"""The parameter space of a sweep: parameters of effects, named `effect.parameter`.

Parameters of the setup itself belong to effects too: `poisson_ratio.nu`, `tool_radius.radius`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from palpate.effects import Effect, Parameter, effect_named
from palpate.effects.base import with_effects
from palpate.foundation.errors import EffectError, PalpateError
from palpate.setup.setup import Setup

__all__ = ["Axis", "ParameterSpace", "Values"]

Values = Mapping[str, float | str]


def _parameter(name: str) -> tuple[type[Effect], Parameter]:
    """Return the effect and the parameter of `effect.parameter`; EffectError if unknown."""
    cause, _, key = name.partition(".")
    effect = effect_named(cause)
    for item in effect.parameters():
        if item.name == key:
            return effect, item
    known = ", ".join(f"{cause}.{item.name}" for item in effect.parameters())
    raise EffectError(f"{cause} has no parameter {key!r}; it has {known}", parameter=name)


@dataclass(frozen=True)
class Axis:
    """One swept parameter and its range.

    Attributes:
        name: the parameter, as `effect.parameter`.
        low: lower end of the range [SI unit of the parameter].
        high: upper end of the range [SI unit of the parameter].

    EffectError for a parameter that is not a number or a range outside the effect's bounds.
    """

    name: str
    low: float
    high: float

    def __post_init__(self) -> None:
        item = self.parameter
        if item.choices:
            raise EffectError(
                f"{self.name} is not a number and cannot be swept; "
                f"fix it to one of {', '.join(item.choices)}",
                parameter=self.name,
            )
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise EffectError(
                f"{self.name}: {self.low:g} to {self.high:g} is no range; "
                "give the lower bound first",
                parameter=self.name,
            )
        if self.low < item.low or self.high > item.high:
            raise EffectError(
                f"{self.name}: {self.low:g} to {self.high:g} {item.unit} is outside "
                f"{item.low:g} to {item.high:g} {item.unit}",
                parameter=self.name,
                low=item.low,
                high=item.high,
            )

    @property
    def parameter(self) -> Parameter:
        """The parameter as the effect declares it."""
        return _parameter(self.name)[1]

    @property
    def ends(self) -> tuple[float, float]:
        """The range in search coordinates (`Parameter.coordinate`)."""
        return self.parameter.coordinate(self.low), self.parameter.coordinate(self.high)

    def value(self, coordinate: float) -> float:
        """Return the value at a search coordinate, clipped to the range."""
        return float(min(max(self.parameter.value(coordinate), self.low), self.high))

    def line(self, count: int) -> list[float]:
        """Return `count` values, evenly spaced in the search coordinate, both ends included."""
        return [self.value(float(place)) for place in np.linspace(*self.ends, count)]


@dataclass(frozen=True)
class ParameterSpace:
    """The axes of a sweep and parameters that are fixed at given values.

    Attributes:
        axes: the swept parameters.
        fixed: values of other parameters, which replace those of the setup.
    """

    axes: tuple[Axis, ...]
    fixed: Values = field(default_factory=dict)

    def __post_init__(self) -> None:
        names = [axis.name for axis in self.axes]
        if not names:
            raise EffectError("no parameter is swept; name one, such as poisson_ratio.nu")
        for name in (*names, *self.fixed):
            if names.count(name) + (name in self.fixed) > 1:
                raise EffectError(
                    f"{name} is named twice; name each parameter once", parameter=name
                )
        for name in self.fixed:
            _parameter(name)

    def tool_radii(self, stated: Setup) -> list[float]:
        """Radii [m] of the tool at both ends of each axis; those of all points lie between."""
        radii = []
        for axis in self.axes:
            for end in (axis.low, axis.high):
                # An end that is impossible with the other parameters as stated has no setup.
                with suppress(PalpateError):
                    radii.append(self.setup(stated, {axis.name: end}).tool.radius)
        return radii

    def stated_values(self, stated: Setup) -> dict[str, float]:
        """Stated value of each axis whose effect is one number; a lump not there has none."""
        found = {}
        for axis in self.axes:
            cause, _, key = axis.name.partition(".")
            effect = effect_named(cause)
            if len(effect.parameters()) == 1:
                found[axis.name] = float(getattr(effect.neutral(stated), key))
        return found

    def setup(self, stated: Setup, values: Values) -> Setup:
        """Return the stated setup with these parameter values and the fixed ones.

        Parameters of an effect that are not named keep the values of the setup.
        """
        return with_effects(stated, self.effects(stated, values))

    def effects(self, stated: Setup, values: Values) -> list[Effect]:
        """Return the effects that make the stated setup that of these parameter values."""
        by_effect: dict[str, dict[str, Any]] = {}
        for name, value in {**self.fixed, **values}.items():
            cause, _, key = name.partition(".")
            by_effect.setdefault(cause, {})[key] = value
        return [
            replace(effect_named(cause).neutral(stated), **parameters)
            for cause, parameters in by_effect.items()
        ]
