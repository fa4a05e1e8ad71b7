"""Effects of a package of its own: two of the catalogue's, copied under other names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import EntryPoint
from typing import Self

from palpate.effects import (
    CATALOGUE,
    Effect,
    Linearisation,
    Measurement,
    NuisanceBlock,
    Slot,
    Tangent,
    parameter,
)
from palpate.effects.plugins import GROUP, outside_effects
from palpate.setup.setup import Layer, Setup

__all__ = ["COPIES", "Ball", "Coating", "with_copies"]


@dataclass(frozen=True, kw_only=True)
class Coating(Effect):
    """A skin of other stiffness on the top."""

    name, enters = "coating", Slot.MATERIAL
    summary = "a coating lies on the top"
    linearisation, amplitude = Linearisation.TANGENT, "stiffness_ratio"
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    needs_box = True
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
        return [
            Tangent(effect=cls(thickness=thickness, stiffness_ratio=1.0), of=cls.amplitude)
            for thickness in (2e-3, 5e-3)
        ]

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.layer is None:
            return setup
        layer = Layer(thickness=self.thickness, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, layer=layer))


@dataclass(frozen=True, kw_only=True)
class Ball(Effect):
    """A ball of another size than stated."""

    name, enters = "ball", Slot.TOOL
    summary = "the ball has another size than stated"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.TOOL_RADIUS
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    strongly_nonlinear = True
    radius: float = parameter("m", low=1e-3, high=2e-2, scale=3e-4, accuracy=5e-5)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(radius=setup.tool.radius)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(radius=setup.tool.radius * factor) for factor in (0.82, 1.2)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, tool=replace(setup.tool, radius=self.radius))


COPIES = {"surface_layer": "coating", "tool_radius": "ball"}
"""Name in the catalogue to that of the copy."""


def with_copies() -> tuple[type[Effect], ...]:
    """Return the catalogue with the two effects replaced by their copies, found as plug-ins."""
    points = [
        EntryPoint("coating", f"{__name__}:Coating", GROUP),
        EntryPoint("ball", f"{__name__}:Ball", GROUP),
    ]
    known = [kind.name for kind in CATALOGUE if kind.name not in COPIES]
    found = {kind.name: kind for kind in outside_effects(known, points)}
    return tuple(found[COPIES[kind.name]] if kind.name in COPIES else kind for kind in CATALOGUE)
