"""Causes in the build of the material: skins, gradients, fibres, and strain stiffening."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

from palpate.effects.base import Effect, Slot
from palpate.effects.family import STIFFNESS
from palpate.effects.linearisation import Linearisation, Measurement, Tangent
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.setup import Fibres, Layer, Setup

__all__ = ["Anisotropy", "StiffnessGradient", "StrainStiffening", "SurfaceLayer"]

_UNLIMITED = 1e4
"""J_m from which on a material counts as having no limit of stretch [1]."""
_SCREENED_LIMIT = 6.0
"""J_m [1] whose whole first-order change is the column of strain stiffening. Measured: it has a
correlation of 0.99 with replays of J_m 1 and 3."""


@dataclass(frozen=True, kw_only=True)
class SurfaceLayer(Effect):
    """A skin of other stiffness, such as a coating or a capsule.

    It lies on the top of a block, and on the free surface of any other body.
    """

    name, enters = "surface_layer", Slot.MATERIAL
    family = STIFFNESS
    summary = "a skin of other stiffness lies on the surface"
    linearisation, amplitude = Linearisation.TANGENT, "stiffness_ratio"
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    thickness: float = parameter("m", low=3e-4, high=2e-2, scale=5e-4, accuracy=3e-4)
    stiffness_ratio: float = parameter("1", low=0.02, high=50.0, scale=0.5, log=True, accuracy=0.15)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        layer = setup.material.layer or Layer(thickness=2e-3, stiffness_ratio=1.0)
        return cls(thickness=layer.thickness, stiffness_ratio=layer.stiffness_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(thickness=2e-3, stiffness_ratio=ratio) for ratio in (0.3, 4.0)]

    @classmethod
    def tangents(cls, setup: Setup) -> Sequence[Tangent]:
        """Return the columns of a thin and of a thick skin.

        Measured: a skin of 0.3 or 4 times the stiffness has a correlation of 0.98 with them.
        """
        return [
            Tangent(effect=cls(thickness=thickness, stiffness_ratio=1.0), of=cls.amplitude)
            for thickness in (2e-3, 5e-3)
        ]

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.layer is None:
            return setup
        layer = Layer(thickness=self.thickness, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, layer=layer))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        thickness, ratio = quantity(values["thickness"], "m"), values["stiffness_ratio"]
        return f"a skin {thickness} thick, {ratio:.2g} times as stiff"


@dataclass(frozen=True, kw_only=True)
class StiffnessGradient(Effect):
    """Stiffness that changes through the height at the same geometric mean.

    log_ratio is ln(E top / E base). Measured: the column has a correlation of 0.999 with replays of
    gradients of 0.7 and -1.2.
    """

    name, enters = "stiffness_gradient", Slot.MATERIAL
    family = STIFFNESS
    summary = "the stiffness changes from the base to the top"
    linearisation = Linearisation.TANGENT
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    log_ratio: float = parameter("1", low=-3.0, high=3.0, scale=0.2, accuracy=0.095)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(log_ratio=setup.material.log_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(log_ratio=ratio) for ratio in (-0.7, 0.7)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, log_ratio=self.log_ratio))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        ratio = values["log_ratio"]
        where, other = ("top", "base") if ratio >= 0 else ("base", "top")
        return (
            "that the stiffness changes with the height: "
            f"the {where} is {math.exp(abs(ratio)):.2g} times as stiff as the {other}"
        )


@dataclass(frozen=True, kw_only=True)
class StrainStiffening(Effect):
    """A material that stiffens with strain: Gent's law."""

    name, enters = "strain_stiffening", Slot.MATERIAL
    family = STIFFNESS
    summary = "the material stiffens with strain"
    linearisation = Linearisation.TANGENT
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    J_m: float = parameter("1", low=0.5, high=_UNLIMITED, scale=0.3, log=True, accuracy=0.08)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        limit = setup.material.stretch_limit
        return cls(J_m=_UNLIMITED if limit is None else min(limit, _UNLIMITED))

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(J_m=limit) for limit in (3.0, 12.0)]

    @classmethod
    def tangents(cls, setup: Setup) -> Sequence[Tangent]:
        """Return one column, which is a share of the whole change of a moderate limit."""
        return [Tangent(effect=cls(J_m=_SCREENED_LIMIT), deviation=1.0)]

    def scaled(self, share: float) -> Self:
        """Return the limit at which the material stiffens by this share [1]."""
        return self.moved([self.J_m / share])

    def apply(self, setup: Setup) -> Setup:
        limit = None if self.J_m >= _UNLIMITED else self.J_m
        return replace(setup, material=replace(setup.material, stretch_limit=limit))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return f"that the material stiffens with strain, Gent's J_m = {values['J_m']:.2g}"


@dataclass(frozen=True, kw_only=True)
class Anisotropy(Effect):
    """Fibres along one direction in the plane.

    Measured: fibres of 3 times the stiffness have a correlation of 0.95 with the columns.
    """

    name, enters = "anisotropy", Slot.MATERIAL
    summary = "the material is stiffer along one direction"
    linearisation, amplitude = Linearisation.TANGENT, "stiffness_ratio"
    amplitude_deviation = 2.0
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    direction: float = parameter("rad", low=0.0, high=math.pi, scale=0.3, periodic=True)
    stiffness_ratio: float = parameter("1", low=1.0, high=30.0, scale=0.3, log=True, accuracy=0.09)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        fibres = setup.material.fibres or Fibres(direction=0.0, stiffness_ratio=1.0)
        return cls(direction=fibres.direction % math.pi, stiffness_ratio=fibres.stiffness_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [
            cls(direction=angle, stiffness_ratio=3.0)
            for angle in (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)
        ]

    def initial_guess(self, changes: Mapping[str, float]) -> Self:
        """Return fibres that are stiffer; softer along one direction is stiffer across it."""
        change = changes[self.amplitude]
        if change >= 0:
            return super().initial_guess(changes)
        across = replace(self, direction=(self.direction + math.pi / 2) % math.pi)
        return super(Anisotropy, across).initial_guess({self.amplitude: -change})

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.fibres is None:
            return setup
        fibres = Fibres(direction=self.direction, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, fibres=fibres))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        stiffer = f"{values['stiffness_ratio']:.2g} times as stiff along one direction as across"
        # A direction has no zero: two digits of 106.9 degrees are outside an interval of two.
        angle = math.degrees(values["direction"])
        return f"fibres: the phantom is {stiffer}, {angle:.0f}° from its long side"
