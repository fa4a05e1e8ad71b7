"""Causes in how the material is built: skins, gradients, fibres, and stiffening with strain."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from palpate.effects.base import Effect, Slot, parameter
from palpate.setup.setup import Fibres, Layer, Setup

__all__ = ["Anisotropy", "StiffnessGradient", "StrainStiffening", "SurfaceLayer"]

_UNLIMITED = 1e4
"""J_m from which on a material is taken to have no limit [1]."""


@dataclass(frozen=True, kw_only=True)
class SurfaceLayer(Effect):
    """A skin of other stiffness on the top: a coating, a capsule."""

    name, enters = "surface_layer", Slot.MATERIAL
    summary = "a skin of other stiffness lies on the top"
    thickness: float = parameter("m", low=3e-4, high=2e-2, scale=5e-4, accuracy=3e-4)
    stiffness_ratio: float = parameter("1", low=0.02, high=50.0, scale=0.5, log=True, accuracy=0.15)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        layer = setup.material.layer or Layer(thickness=2e-3, stiffness_ratio=1.0)
        return cls(thickness=layer.thickness, stiffness_ratio=layer.stiffness_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(thickness=2e-3, stiffness_ratio=ratio) for ratio in (0.3, 4.0)]

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.layer is None:
            return setup
        layer = Layer(thickness=self.thickness, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, layer=layer))


@dataclass(frozen=True, kw_only=True)
class StiffnessGradient(Effect):
    """Stiffness that changes through the height, its geometric mean kept: log_ratio = ln(E top / E
    base).
    """

    name, enters = "stiffness_gradient", Slot.MATERIAL
    summary = "the stiffness changes from the base to the top"
    log_ratio: float = parameter("1", low=-3.0, high=3.0, scale=0.2, accuracy=0.04)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(log_ratio=setup.material.log_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(log_ratio=ratio) for ratio in (-0.7, 0.7)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, log_ratio=self.log_ratio))


@dataclass(frozen=True, kw_only=True)
class StrainStiffening(Effect):
    """A material that stiffens with strain: Gent's law."""

    name, enters = "strain_stiffening", Slot.MATERIAL
    summary = "the material stiffens with strain"
    J_m: float = parameter("1", low=0.5, high=_UNLIMITED, scale=0.3, log=True)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        limit = setup.material.stretch_limit
        return cls(J_m=_UNLIMITED if limit is None else min(limit, _UNLIMITED))

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(J_m=limit) for limit in (3.0, 12.0)]

    def apply(self, setup: Setup) -> Setup:
        limit = None if self.J_m >= _UNLIMITED else self.J_m
        return replace(setup, material=replace(setup.material, stretch_limit=limit))


@dataclass(frozen=True, kw_only=True)
class Anisotropy(Effect):
    """Fibres along one direction in the plane."""

    name, enters = "anisotropy", Slot.MATERIAL
    summary = "the material is stiffer along one direction"
    direction: float = parameter("rad", low=0.0, high=math.pi, scale=0.3, periodic=True)
    stiffness_ratio: float = parameter("1", low=1.0, high=30.0, scale=0.3, log=True)

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

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.fibres is None:
            return setup
        fibres = Fibres(direction=self.direction, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, fibres=fibres))
