"""Causes inside the material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from palpate.effects.base import Effect, Slot
from palpate.effects.family import STIFFNESS
from palpate.effects.linearisation import Linearisation, Measurement, NuisanceBlock
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.bounds import MODULI
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Inclusion, Setup

__all__ = [
    "MODULUS_ACCURACY",
    "POISSON_BOUNDS",
    "PoissonRatio",
    "StiffInclusion",
    "YoungModulus",
    "inclusion_grid",
]

POISSON_BOUNDS = (0.0, 0.495)
"""Poisson's ratios that a replay can have [1]."""
MODULUS_ACCURACY = 0.03
"""Relative standard deviation of a modulus that the replay's own error leaves [1]. Grid and law
contribute in equal parts, and so does the sensor's gain."""


def inclusion_grid(setup: Setup) -> tuple[Inclusion, ...]:
    """Return inclusions on a coarse grid of places in the body, five times as stiff as it.

    The grid spans the bounding box; of a free form, places outside the body are left out.
    """
    body = setup.geometry
    x, y, z = body.size
    middle_x, middle_y, _ = ((body.low + body.high) / 2).tolist()
    grid = [
        (middle_x + (i - 0.5 * 6) / 7 * x, middle_y + (j - 1) / 3 * y, height * z)
        for i in range(7)
        for j in range(3)
        for height in (0.45, 0.72)
    ]
    if not body.is_block:
        inside = body.outside(np.array(grid)) < 0
        grid = [place for place, kept in zip(grid, inside, strict=True) if kept] or grid
    return tuple(Inclusion(x=x, y=y, z=z, radius=7e-3, stiffness_ratio=5.0) for x, y, z in grid)


@dataclass(frozen=True, kw_only=True)
class PoissonRatio(Effect):
    """A compressibility other than assumed."""

    name, enters = "poisson_ratio", Slot.MATERIAL
    summary = "the material is more or less compressible than assumed"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.POISSON_RATIO
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    nu: float = parameter(
        "1", low=POISSON_BOUNDS[0], high=POISSON_BOUNDS[1], scale=0.02, accuracy=8e-3
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        low, high = POISSON_BOUNDS
        return cls(nu=min(max(setup.material.poisson_ratio, low), high))

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(nu=nu) for nu in (0.36, 0.485) if abs(nu - setup.material.poisson_ratio) > 0.01]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, poisson_ratio=self.nu))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return f"another compressibility: Poisson's ratio is {values['nu']:.3g}"


@dataclass(frozen=True, kw_only=True)
class StiffInclusion(Effect):
    """A ball of other stiffness inside, such as a tumour or a bubble."""

    name, enters = "stiff_inclusion", Slot.MATERIAL
    family = STIFFNESS
    summary = "a lump of other stiffness lies inside"
    linearisation, amplitude = Linearisation.LOCAL_STIFFNESS, "stiffness_ratio"
    amplitude_deviation = 0.8
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    x: float = parameter("m", low=-0.5, high=0.5, scale=3e-3, accuracy=1.4e-4)
    y: float = parameter("m", low=-0.5, high=0.5, scale=3e-3, accuracy=1.4e-4)
    z: float = parameter("m", low=0.0, high=0.5, scale=3e-3, accuracy=5e-4)
    radius: float = parameter("m", low=2e-3, high=2e-2, scale=0.25, log=True)
    stiffness_ratio: float = parameter(
        "1", low=0.02, high=50.0, scale=0.15, contrast=True, accuracy=0.04
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        body = setup.geometry
        x, y, _ = ((body.low + body.high) / 2).tolist()
        return cls(x=x, y=y, z=body.size[2] / 2, radius=7e-3, stiffness_ratio=1.0)

    @classmethod
    def spans(cls, body: Geometry) -> dict[str, tuple[float, float]]:
        """Return the places within the bounding box."""
        ends = zip(body.low.tolist(), body.high.tolist(), strict=True)
        return dict(zip("xyz", ends, strict=True))

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Return inclusions all over the block; their gains are screened by element
        sensitivities.
        """
        return [
            replace(cls.placed(place), stiffness_ratio=place.stiffness_ratio)
            for place in inclusion_grid(setup)
        ]

    @classmethod
    def placed(cls, place: Inclusion) -> Self:
        return cls(x=place.x, y=place.y, z=place.z, radius=place.radius, stiffness_ratio=1.0)

    @property
    def inclusion(self) -> Inclusion:
        """The ball with its place, radius and stiffness ratio."""
        return Inclusion(
            x=self.x, y=self.y, z=self.z, radius=self.radius, stiffness_ratio=self.stiffness_ratio
        )

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0:
            return setup
        inclusions = (*setup.material.inclusions, self.inclusion)
        return replace(setup, material=replace(setup.material, inclusions=inclusions))

    def located(self, setup: Setup) -> dict[str, Any]:
        """Return `depth`: of the centre below the nearest free surface [m], of a free form, whose
        top is elsewhere at each place.
        """
        if setup.geometry.is_block:
            return {}
        depth = -setup.geometry.facing_free(np.array([[self.x, self.y, self.z]]))[0][0]
        return {"depth": {"value": round(float(depth), 5), "unit": "m"}}

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        kind = "stiff" if values["stiffness_ratio"] >= 1.0 else "soft"
        across, depth = quantity(2 * values["radius"], "m"), values.get("depth")
        if depth is not None:
            # Of a free form, or found from forces alone: the depth is that below the nearest skin.
            return f"a {kind} lump, {across} across, its centre {depth} under the surface"
        place = f", {quantity(size[2] - values['z'], 'm')} under the top" if size else ""
        return f"a {kind} lump, {across} across{place}"


@dataclass(frozen=True, kw_only=True)
class YoungModulus(Effect):
    """A stiffness other than assumed; only measured forces show it.

    Quantities that are stated over E (own weight, springs, tool compliance) keep their value over
    E. The replay's force is right to about 3 %.
    """

    name, enters = "young_modulus", Slot.MATERIAL
    summary = "the material is stiffer or softer than assumed, in all"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.YOUNG_MODULUS
    shown_by = frozenset({Measurement.FORCES})
    E: float = parameter(
        "Pa", low=10.0, high=MODULI[1], scale=0.15, log=True, accuracy=MODULUS_ACCURACY
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(E=setup.material.young_modulus)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(E=factor * setup.material.young_modulus) for factor in (0.7, 1.4)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, young_modulus=self.E))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return f"another stiffness: Young's modulus is {quantity(values['E'], 'Pa')}"
