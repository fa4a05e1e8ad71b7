"""Causes at the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from palpate.effects.base import Effect, Slot, parameter
from palpate.setup.setup import PAIRINGS, Setup

__all__ = ["LandmarkMismatch", "ToolCompliance", "ToolFriction", "ToolOffset", "ToolRadius"]


@dataclass(frozen=True, kw_only=True)
class ToolRadius(Effect):
    """A tool of another size."""

    name, enters = "tool_radius", Slot.TOOL
    summary = "the tool has another size than stated"
    radius: float = parameter("m", low=1e-3, high=2e-2, scale=3e-4, accuracy=5e-5)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(radius=setup.tool.radius)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(radius=setup.tool.radius * factor) for factor in (0.82, 1.2)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, tool=replace(setup.tool, radius=self.radius))


@dataclass(frozen=True, kw_only=True)
class ToolOffset(Effect):
    """The tool's centre is not where the kinematics say, though the touches were right: true minus
    stated, phantom frame.
    """

    name, enters = "tool_offset", Slot.TOOL
    summary = "the tool's centre is not where the kinematics say"
    dx: float = parameter("m", low=-5e-3, high=5e-3, scale=5e-4)
    dy: float = parameter("m", low=-5e-3, high=5e-3, scale=5e-4)
    dz: float = parameter("m", low=-5e-3, high=5e-3, scale=5e-4)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(dx=0.0, dy=0.0, dz=0.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """From where it is stated; the directions come from the sensitivities."""
        return [cls.neutral(setup)]

    def apply(self, setup: Setup) -> Setup:
        offset = setup.tool.offset
        return replace(
            setup,
            tool=replace(
                setup.tool, offset=(offset[0] + self.dx, offset[1] + self.dy, offset[2] + self.dz)
            ),
        )


@dataclass(frozen=True, kw_only=True)
class ToolCompliance(Effect):
    """The shaft or the cables give way under load: the true centre is the stated one plus C F."""

    name, enters = "tool_compliance", Slot.TOOL
    summary = "the tool gives way under load"
    compliance_times_stiffness: float = parameter("1/m", low=0.0, high=500.0, scale=3.0)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(compliance_times_stiffness=setup.tool.compliance_times_stiffness)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(compliance_times_stiffness=20.0)]

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup,
            tool=replace(setup.tool, compliance_times_stiffness=self.compliance_times_stiffness),
        )


@dataclass(frozen=True, kw_only=True)
class ToolFriction(Effect):
    """The tool drags the surface along: Coulomb's friction with stick and slip."""

    name, enters = "tool_friction", Slot.TOOL
    summary = "the tool drags the surface along"
    # Of a coefficient of 0.5 on two engines and two grids the surface is dragged as far within 3 %,
    # as far as one of 0.515 does.
    friction_coefficient: float = parameter("1", low=0.0, high=3.0, scale=0.1, accuracy=0.02)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(friction_coefficient=setup.tool.friction_coefficient)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(friction_coefficient=friction) for friction in (0.15, 0.5)]

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup, tool=replace(setup.tool, friction_coefficient=self.friction_coefficient)
        )


@dataclass(frozen=True, kw_only=True)
class LandmarkMismatch(Effect):
    """Touches paired with the wrong landmarks, or made beside them.

    The tool then is where the same touches, laid on the right places, put it (see
    `palpate.measurement.touch_correction`). A polygon of another size about the same middle puts it
    where it was: `scale`, and `inset` at corners that lie evenly around, show in what the touches
    miss by, and in no replay.
    """

    name, enters = "landmark_mismatch", Slot.TOOL
    summary = "the touches were of other places than stated"
    pairing: str = parameter("", choices=PAIRINGS)
    scale: float = parameter("1", low=0.6, high=1.6, scale=0.02)
    inset: float = parameter("m", low=-0.01, high=0.02, scale=5e-4)

    @classmethod
    def at_rest(cls) -> bool:
        """The touches are evidence themselves."""
        return True

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        here = setup.touching
        return cls(pairing=here.pairing, scale=here.scale, inset=here.inset)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Every other pairing as it is, and the stated one with touches inside the corners."""
        others = [cls(pairing=pairing, scale=1.0, inset=0.0) for pairing in PAIRINGS[1:]]
        return [
            *others,
            cls(pairing=PAIRINGS[0], scale=0.85, inset=0.0),
            cls(pairing=PAIRINGS[0], scale=1.0, inset=3e-3),
        ]

    def apply(self, setup: Setup) -> Setup:
        touching = replace(setup.touching, pairing=self.pairing, scale=self.scale, inset=self.inset)
        return replace(setup, touching=touching)
