"""Causes in the history of the material (see `palpate.replay.material_history`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Self

from palpate.effects.base import Effect, Slot
from palpate.effects.family import MEMORY
from palpate.effects.linearisation import Linearisation
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.setup import Relaxation, Setup

__all__ = ["PermanentSet", "Viscoelasticity"]


@dataclass(frozen=True, kw_only=True)
class Viscoelasticity(Effect):
    """Relaxation and delayed recovery: one more term of a Prony series."""

    name, enters = "viscoelasticity", Slot.MATERIAL
    family = MEMORY
    summary = "the material relaxes and recovers with delay"
    linearisation = Linearisation.HISTORY
    told_apart_by = MappingProxyType(
        {
            "permanent_set": "let the phantom rest for several time constants after a release and "
            "record it"
        }
    )
    # Measured: after a virtual push of 5 mm the remaining dents of two engines differ by 5 %, and
    # fade at rates within 4 %.
    relaxed_fraction: float = parameter("1", low=0.0, high=0.95, scale=0.1, accuracy=0.02)
    time_constant: float = parameter("s", low=1e-2, high=1e3, scale=0.5, log=True, accuracy=0.04)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(relaxed_fraction=0.0, time_constant=1.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        # A what-if begins with the one in the middle of the list.
        return [cls(relaxed_fraction=0.5, time_constant=seconds) for seconds in (0.3, 3.0, 1.0)]

    def scaled(self, share: float) -> Self:
        """Return the effect with this share [1] of its relaxed fraction."""
        return self.moved([self.relaxed_fraction * share, self.time_constant])

    def apply(self, setup: Setup) -> Setup:
        if not self.relaxed_fraction:
            return setup
        term = Relaxation(fraction=self.relaxed_fraction, time_constant=self.time_constant)
        return replace(
            setup, material=replace(setup.material, relaxation=(*setup.material.relaxation, term))
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        share, time = 100 * values["relaxed_fraction"], quantity(values["time_constant"], "s")
        return (
            f"that the material relaxes, by {share:.0f} % of its stiffness "
            f"with a time constant of {time}"
        )


@dataclass(frozen=True, kw_only=True)
class PermanentSet(Effect):
    """Deformation that remains after release."""

    name, enters = "permanent_set", Slot.MATERIAL
    family = MEMORY
    summary = "part of the deformation stays after release"
    linearisation = Linearisation.HISTORY
    # Measured: after the same push the remaining dents differ by 2 to 3 %.
    retained_fraction: float = parameter("1", low=0.0, high=0.8, scale=0.05, accuracy=0.006)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(retained_fraction=setup.material.retained_fraction)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(retained_fraction=0.15)]

    def scaled(self, share: float) -> Self:
        """Return the effect with this share [1] of its retained fraction."""
        return self.moved([self.retained_fraction * share])

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup, material=replace(setup.material, retained_fraction=self.retained_fraction)
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return (
            f"that {100 * values['retained_fraction']:.0f} % of the deformation stays after release"
        )
