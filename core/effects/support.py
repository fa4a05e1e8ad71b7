"""Causes under the block."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self, cast

from palpate.effects.base import Effect, Slot
from palpate.effects.family import BASE
from palpate.effects.linearisation import Measurement
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.setup import Detachment, Edge, Setup, Shape

__all__ = ["BaseCompliance", "BaseDetachment", "BaseSlip"]

_EDGES = ("-x", "+x", "-y", "+y")
_WIDEST = 0.04
"""Width of a loose strip at most [m]."""
_RIGID = 1e5
"""Stiffness of the springs under the base over E from which on the base counts as rigid [1/m]."""


@dataclass(frozen=True, kw_only=True)
class BaseSlip(Effect):
    """The base slides on the table as a whole, with Coulomb friction under its weight and the
    push.
    """

    name, enters = "base_slip", Slot.SUPPORT
    family = BASE
    summary = "the base slides on the table"
    kinked = True  # a push that slides at one friction holds at the next
    # The accuracy is that of the sideways force, which the grid of a diagnosis has to some percent.
    friction_coefficient: float = parameter(
        "1", low=0.01, high=3.0, scale=0.2, log=True, accuracy=0.04
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        """Return a friction at which no usual push makes the base slide."""
        return cls(friction_coefficient=3.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(friction_coefficient=mu) for mu in (0.08, 0.14, 0.22)]

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup, support=replace(setup.support, friction_coefficient=self.friction_coefficient)
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return (
            "that the base slides on the table, "
            f"with a friction coefficient of {values['friction_coefficient']:.2g}"
        )


@dataclass(frozen=True, kw_only=True)
class BaseDetachment(Effect):
    """A strip of the base along one edge is not held: it may lift, but not go into the table."""

    name, enters = "base_detachment", Slot.SUPPORT
    family = BASE
    summary = "a strip of the base is not held"
    edge: str = parameter("", choices=_EDGES)
    extent: float = parameter("m", low=0.0, high=_WIDEST, scale=2e-3, accuracy=7e-4)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(edge="-x", extent=0.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [
            cls(edge=edge, extent=min(0.35 * width, _WIDEST))
            for edge in _EDGES
            for width in [setup.geometry.size["xy".index(edge[1])]]
        ]

    @classmethod
    def impossible(cls, setup: Setup) -> str:
        body = setup.geometry
        if isinstance(body, Shape) and not body.flat_base:
            return "what holds the phantom is no flat base"
        return super().impossible(setup)

    def apply(self, setup: Setup) -> Setup:
        if self.extent == 0:
            return setup
        strip = Detachment(edge=cast(Edge, self.edge), extent=self.extent)
        return replace(
            setup, support=replace(setup.support, detached=(*setup.support.detached, strip))
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        edge = f"its {str(values['edge']).replace('-', '−')} edge"
        return f"that the base is loose {quantity(values['extent'], 'm')} inwards from {edge}"


@dataclass(frozen=True, kw_only=True)
class BaseCompliance(Effect):
    """An elastic support: springs per area in all directions, over Young's modulus."""

    name, enters = "base_compliance", Slot.SUPPORT
    family = BASE
    summary = "the support under the base gives way"
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    stiffness_over_E: float = parameter(
        "1/m", low=5.0, high=_RIGID, scale=0.3, log=True, accuracy=0.05
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        stiffness = setup.support.stiffness_over_E
        return cls(
            stiffness_over_E=_RIGID if stiffness is None else min(max(stiffness, 5.0), _RIGID)
        )

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(stiffness_over_E=60.0)]

    def scaled(self, share: float) -> Self:
        """Return springs that yield by this share [1]."""
        return self.moved([self.stiffness_over_E / share])

    def apply(self, setup: Setup) -> Setup:
        stiffness = None if self.stiffness_over_E >= _RIGID else self.stiffness_over_E
        return replace(setup, support=replace(setup.support, stiffness_over_E=stiffness))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return f"a compliant support, with springs of {values['stiffness_over_E']:.2g} E per metre"
