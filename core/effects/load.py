"""Causes among the loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from palpate.effects.base import Effect, Slot, parameter
from palpate.setup.setup import Setup

__all__ = ["Gravity"]


@dataclass(frozen=True, kw_only=True)
class Gravity(Effect):
    """Sag under own weight, while the stated shape is the unloaded one."""

    name, enters = "gravity", Slot.LOAD
    summary = "the block sags under its own weight"
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
