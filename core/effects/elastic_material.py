"""Causes inside the material."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from palpate.effects.base import Effect, Slot, parameter
from palpate.setup.setup import Inclusion, Setup

__all__ = ["PoissonRatio", "StiffInclusion", "YoungModulus"]


@dataclass(frozen=True, kw_only=True)
class PoissonRatio(Effect):
    """Another compressibility than assumed."""

    name, enters = "poisson_ratio", Slot.MATERIAL
    summary = "the material is more or less compressible than assumed"
    nu: float = parameter("1", low=0.0, high=0.495, scale=0.02, accuracy=8e-3)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(nu=setup.material.poisson_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(nu=nu) for nu in (0.36, 0.485) if abs(nu - setup.material.poisson_ratio) > 0.01]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, poisson_ratio=self.nu))


@dataclass(frozen=True, kw_only=True)
class StiffInclusion(Effect):
    """A ball of other stiffness inside: a tumour, a bubble."""

    name, enters = "stiff_inclusion", Slot.MATERIAL
    summary = "a lump of other stiffness lies inside"
    x: float = parameter("m", low=-0.5, high=0.5, scale=3e-3)
    y: float = parameter("m", low=-0.5, high=0.5, scale=3e-3)
    z: float = parameter("m", low=0.0, high=0.5, scale=3e-3, accuracy=5e-4)
    radius: float = parameter("m", low=2e-3, high=2e-2, scale=0.25, log=True)
    stiffness_ratio: float = parameter(
        "1", low=0.02, high=50.0, scale=0.15, contrast=True, accuracy=0.04
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(x=0.0, y=0.0, z=setup.geometry.size[2] / 2, radius=7e-3, stiffness_ratio=1.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Places all over the block; which of them deserve a solve is decided from element
        sensitivities.
        """
        x, y, z = setup.box.size
        return [
            cls(
                x=(i - 0.5 * 6) / 7 * x,
                y=(j - 1) / 3 * y,
                z=height * z,
                radius=7e-3,
                stiffness_ratio=ratio,
            )
            for i in range(7)
            for j in range(3)
            for height in (0.45, 0.72)
            for ratio in (5.0,)
        ]

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0:
            return setup
        lump = Inclusion(
            x=self.x, y=self.y, z=self.z, radius=self.radius, stiffness_ratio=self.stiffness_ratio
        )
        return replace(
            setup, material=replace(setup.material, inclusions=(*setup.material.inclusions, lump))
        )


@dataclass(frozen=True, kw_only=True)
class YoungModulus(Effect):
    """Another stiffness than assumed; shows only against something with a force scale of its own, a
    measured force above all.

    What is stated over E (own weight, springs, a tool that gives way) stays as it is over E. The
    replay's force is right to about 3 %: its grid and its law in equal parts, and the sensor's
    gain.
    """

    name, enters = "young_modulus", Slot.MATERIAL
    summary = "the material is stiffer or softer than assumed, in all"
    E: float = parameter("Pa", low=10.0, high=1e8, scale=0.15, log=True, accuracy=0.03)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(E=setup.material.young_modulus)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(E=factor * setup.material.young_modulus) for factor in (0.7, 1.4)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, young_modulus=self.E))
