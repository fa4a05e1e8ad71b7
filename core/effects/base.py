"""The base class of effects: parameters, one pure function from setup to setup, and properties.

A subclass declares by class attributes how a diagnosis screens it, which data show it, and where a
fit starts. All of them have defaults.
"""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from types import MappingProxyType
from typing import Any, ClassVar, Self

from palpate.effects.family import Family
from palpate.effects.linearisation import Linearisation, Measurement, NuisanceBlock, Tangent
from palpate.effects.parameter import Parameter
from palpate.foundation.errors import EffectError
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import AnyInclusion, Inclusion, Setup

__all__ = ["MEASURE_SIZE", "Effect", "Slot", "with_effects"]

MEASURE_SIZE = "measure the phantom with a calliper"
"""Measurement that tells the phantom's size from effects that look like it."""


class Slot(Enum):
    """The part of the experiment that an effect changes.

    SENSOR effects change the observation only, so that no equilibrium is solved anew.
    """

    GEOMETRY = "geometry"
    MATERIAL = "material"
    LOAD = "load"
    SUPPORT = "support"
    TOOL = "tool"
    SENSOR = "sensor"


@dataclass(frozen=True, kw_only=True)
class Effect(ABC):
    """One possible cause of a simulation's error.

    A subclass is a frozen dataclass whose fields are made by `parameter`. It must have `name`,
    `enters`, `summary`, `neutral`, `starts` and `apply`; the other members have defaults.
    """

    name: ClassVar[str]
    """Name in reports, unique in the catalogue."""
    enters: ClassVar[Slot]
    """Part of the experiment that the effect changes."""
    summary: ClassVar[str]
    """One clause that states the cause, for reports."""
    linearisation: ClassVar[Linearisation] = Linearisation.FINITE_DIFFERENCE
    """How the screening makes columns of the effect."""
    amplitude: ClassVar[str] = ""
    """Number in proportion to which the effect grows; the others then only say where it is. Empty:
    each number has a column of its own."""
    amplitude_deviation: ClassVar[float | None] = None
    """Prior standard deviation of the amplitude's search coordinate; None for the usual number of
    its scales."""
    joint: ClassVar[bool] = False
    """Whether all numbers together are one candidate, as none of them is plausible alone."""
    nuisance: ClassVar[NuisanceBlock | None] = None
    """Nuisance parameters whose columns the effect shares, in the order of its numbers; stated for
    the linearisation NUISANCE."""
    shown_by: ClassVar[frozenset[Measurement]] = frozenset({Measurement.CLOUDS})
    """Kinds of measurement any of which shows the effect."""
    needs_box: ClassVar[bool] = False
    """Whether only a box can have it, and no body of another shape."""
    needs_shape: ClassVar[bool] = False
    """Whether only a free form can have it, and no block."""
    by_hand: ClassVar[bool] = True
    """Whether each number means something alone, so that people set and sweep it."""
    kinked: ClassVar[bool] = False
    """Whether something begins or ends with its numbers, as a slide does: a fit then tries values
    to either side, and single pushes have no derivative by them."""
    strongly_nonlinear: ClassVar[bool] = False
    """Whether a derivative says little about finite sizes: the effect is then refitted whatever
    its gain in the linear screening."""
    needs_fine_mesh: ClassVar[bool] = False
    """Whether finite differences need the mesh of the diagnosis; the coarse mesh of the screening
    does for others."""
    family: ClassVar[Family | None] = None
    """Effects that act in the same way by other laws; None for an effect without relatives."""
    told_apart_by: ClassVar[Mapping[str, str]] = MappingProxyType({})
    """Name of another effect to a measurement, which is no push, that tells the two apart."""

    def __post_init__(self) -> None:
        for item in self.parameters():
            value = getattr(self, item.name)
            if item.choices:
                if value not in item.choices:
                    raise EffectError(
                        f"{self.name}: {item.name} = {value!r} is none of "
                        f"{', '.join(item.choices)}",
                        parameter=item.name,
                        value=value,
                    )
            elif not (math.isfinite(value) and item.low <= value <= item.high):
                raise EffectError(
                    f"{self.name}: {item.name} = {value:g} {item.unit} is outside "
                    f"{item.low:g} to {item.high:g} {item.unit}",
                    parameter=item.name,
                    value=value,
                    low=item.low,
                    high=item.high,
                )

    @classmethod
    def parameters(cls) -> tuple[Parameter, ...]:
        """Return the parameters in the order of the fields."""
        return tuple(
            Parameter(name=field.name, **field.metadata) for field in dataclasses.fields(cls)
        )

    @classmethod
    def numbers(cls) -> tuple[Parameter, ...]:
        """Return the parameters that are numbers, which a fit may change."""
        return tuple(item for item in cls.parameters() if not item.choices)

    @classmethod
    @abstractmethod
    def neutral(cls, setup: Setup) -> Self:
        """Return the instance that changes nothing in this setup."""

    @classmethod
    @abstractmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Return finite sizes at which a search begins, spread over what is plausible."""

    @abstractmethod
    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this effect in it."""

    @classmethod
    def impossible(cls, setup: Setup) -> str:
        """Return why nothing in this setup can have the effect, as a clause; empty if it can."""
        if cls.needs_box and not setup.geometry.is_block:
            return "only a block can have it"
        if cls.needs_shape and setup.geometry.is_block:
            return "only a phantom whose surface is stated as a file can have it"
        return ""

    @classmethod
    def spans(cls, body: Geometry) -> dict[str, tuple[float, float]]:
        """Return lowest and highest value [SI] by name of numbers to which a body of this extent
        sets narrower limits than their bounds, such as places; by default of none.
        """
        return {}

    # -- properties that a diagnosis reads --------------------------------------------------------

    @classmethod
    def at_rest(cls) -> bool:
        """Return whether the rest cloud or the touches show the effect."""
        return cls.enters in (Slot.LOAD, Slot.GEOMETRY)

    @classmethod
    def has_history(cls) -> bool:
        """Return whether a frame with the effect depends on the frames before it."""
        return cls.linearisation is Linearisation.HISTORY

    @classmethod
    def has_derivative(cls) -> bool:
        """Return whether a replay with the effect has derivatives by its numbers."""
        return not cls.has_history()

    @classmethod
    def tangents(cls, setup: Setup) -> Sequence[Tangent]:
        """Return the columns of an effect with the linearisation TANGENT.

        By default one column of the amplitude at each start that differs in the other numbers; or,
        without an amplitude, one column of each number.
        """
        neutral = cls.neutral(setup)
        if not cls.amplitude:
            return [Tangent(effect=neutral, of=item.name) for item in cls.numbers()]
        value = {cls.amplitude: getattr(neutral, cls.amplitude)}
        points = dict.fromkeys(dataclasses.replace(start, **value) for start in cls.starts(setup))
        return [
            Tangent(effect=point, of=cls.amplitude, deviation=cls.amplitude_deviation)
            for point in points
        ]

    def initial_guess(self, changes: Mapping[str, float]) -> Self:
        """Return the effect from which a fit starts, where columns belong to single numbers.

        Args:
            changes: name of a number to the change of its search coordinate that the linear fit
                found, clipped to what is plausible.
        """
        coordinates = self.coordinates
        for place, item in enumerate(self.numbers()):
            coordinates[place] += changes.get(item.name, 0.0)
        return self.at(coordinates)

    def scaled(self, share: float) -> Self:
        """Return the effect from which a fit starts, where one column is its whole change.

        By default the effect itself, as the size of a nonlinear effect does not follow from it.

        Args:
            share: multiple [1] of the effect's change that the linear fit found, clipped to what
                is plausible.
        """
        return self

    @property
    def inclusion(self) -> Inclusion | None:
        """The ball of other stiffness that the effect puts into the body; None for most."""
        return None

    @classmethod
    def placed(cls, place: Inclusion) -> Self:
        """Return the neutral effect at a place, for the linearisation LOCAL_STIFFNESS."""
        raise EffectError(f"{cls.name} has no place in the body")

    def lump(self, setup: Setup) -> AnyInclusion | None:
        """Return the part of other stiffness that the effect puts into the body of this setup; by
        default `inclusion`.
        """
        return self.inclusion

    @classmethod
    def screened(
        cls, places: Sequence[Inclusion], setup: Setup
    ) -> Sequence[tuple[Self, AnyInclusion]]:
        """Return the neutral effects that are screened, for the linearisation LOCAL_STIFFNESS.

        By default there is one at each place.

        Args:
            places: balls on a grid, or below what the tool touched.
            setup: as stated.

        Returns:
            the effects, each with the part of the body whose stiffness it changes.
        """
        return [(cls.placed(place), place) for place in places]

    @classmethod
    def around(cls, found: Inclusion, setup: Setup) -> Sequence[tuple[Self, AnyInclusion]]:
        """Return neutral effects of another shape that may be there where a ball was fitted, each
        with the part of the body whose stiffness it changes; none by default.
        """
        return []

    @classmethod
    def of_touches(cls, pairing: str) -> Self | None:
        """Return the effect of touching the landmarks in this order; None for most effects."""
        return None

    # -- values -----------------------------------------------------------------------------------

    def values(self) -> dict[str, float | str]:
        """Return the value of each parameter by name, in SI units."""
        return {item.name: getattr(self, item.name) for item in self.parameters()}

    def reported(self, setup: Setup) -> dict[str, tuple[float | str, str]]:
        """Return (value, unit) by name as a report states them for this setup.

        These are the parameters; an effect may add numbers that follow from them.
        """
        return {item.name: (getattr(self, item.name), item.unit) for item in self.parameters()}

    def located(self, setup: Setup) -> dict[str, Any]:
        """Return what a report's cause states of the effect's place beside the parameters, as plain
        values; nothing by default.
        """
        return {}

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        """The cause as a noun phrase, to follow "the simulation misses".

        Args:
            values: of the parameters and of what `reported` adds, SI. "depth" is a text with the
                interval of a depth below the skin, where a report states one.
            size: extent (3,) of the phantom along x, y, z [m], where they are known.
        """
        return f"that {cls.summary}"

    def moved(self, values: Sequence[float]) -> Self:
        """Return the same effect with other numbers, clipped to their bounds."""
        pairs = zip(self.numbers(), values, strict=True)
        return dataclasses.replace(self, **{item.name: item.bounded(float(v)) for item, v in pairs})

    @property
    def coordinates(self) -> list[float]:
        """Search coordinates of the numbers."""
        return [item.coordinate(getattr(self, item.name)) for item in self.numbers()]

    def at(self, coordinates: Sequence[float]) -> Self:
        """Return the same effect at other search coordinates, clipped to just within the bounds.

        At a bound an effect can be absent, as a base is rigid there. An absent effect has no
        first-order changes.
        """
        return self.moved(
            [item.within(float(c)) for item, c in zip(self.numbers(), coordinates, strict=True)]
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain values from which `palpate.effects.from_json` makes the same effect."""
        return {"effect": self.name, "parameters": self.values()}


def with_effects(setup: Setup, effects: Sequence[Effect]) -> Setup:
    """Return the setup with all of the effects in it, applied one after another."""
    for effect in effects:
        setup = effect.apply(setup)
    return setup
