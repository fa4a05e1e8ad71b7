"""Causes under the block."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self, cast

from core.effects.base import Effect, Slot, parameter
from core.setup import Detachment, Edge, Setup

__all__ = ["BaseDetachment", "BaseSlip"]

_EDGES = ("-x", "+x", "-y", "+y")


@dataclass(frozen=True, kw_only=True)
class BaseSlip(Effect):
    """The base slides on the table as a whole, with Coulomb friction against its weight and the push."""

    name, enters = "base_slip", Slot.SUPPORT
    summary = "the base slides on the table"
    # Friction is told from the sideways force, which a replay on the grid for diagnosis has to some percent only.
    friction_coefficient: float = parameter("1", low=0.01, high=3.0, scale=0.2, log=True, accuracy=0.04)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        """So rough that nothing in this catalogue's motions slides."""
        return cls(friction_coefficient=3.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(friction_coefficient=mu) for mu in (0.08, 0.14, 0.22)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, support=replace(setup.support, friction_coefficient=self.friction_coefficient))


@dataclass(frozen=True, kw_only=True)
class BaseDetachment(Effect):
    """A strip of the base along one edge is not held: it may lift, but not go through the table."""

    name, enters = "base_detachment", Slot.SUPPORT
    summary = "a strip of the base is not held"
    edge: str = parameter("", choices=_EDGES)
    extent: float = parameter("m", low=0.0, high=0.04, scale=2e-3)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(edge="-x", extent=0.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(edge=edge, extent=0.35 * setup.geometry.size["xy".index(edge[1])]) for edge in _EDGES]

    def apply(self, setup: Setup) -> Setup:
        if self.extent == 0:
            return setup
        strip = Detachment(edge=cast(Edge, self.edge), extent=self.extent)
        return replace(setup, support=replace(setup.support, detached=(*setup.support.detached, strip)))
