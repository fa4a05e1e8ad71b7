"""Causes among the loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Self

from palpate.effects.base import MEASURE_SIZE, Effect, Slot
from palpate.effects.parameter import parameter
from palpate.setup.setup import Setup

__all__ = ["Gravity"]


@dataclass(frozen=True, kw_only=True)
class Gravity(Effect):
    """Sag under own weight, while the stated shape is the unloaded one."""

    name, enters = "gravity", Slot.LOAD
    summary = "the phantom sags under its own weight"
    # Measured: on the coarse mesh of the screening its pattern has a correlation of 0.89 with the
    # right one; the patterns of other effects have 0.99.
    needs_fine_mesh = True
    told_apart_by = MappingProxyType(
        {
            "camera_registration": "record the untouched phantom again from another side, or "
            "turned on its side",
            "geometry_scale": MEASURE_SIZE,
        }
    )
    specific_weight_over_stiffness: float = parameter(
        "1/m", low=0.0, high=8.0, scale=0.5, accuracy=0.15
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(specific_weight_over_stiffness=setup.load.specific_weight_over_stiffness)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(specific_weight_over_stiffness=1.5)]

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup,
            load=replace(
                setup.load, specific_weight_over_stiffness=self.specific_weight_over_stiffness
            ),
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        weight = values["specific_weight_over_stiffness"]
        return f"the phantom's own weight, ρg/E = {weight:.2g} per metre"
