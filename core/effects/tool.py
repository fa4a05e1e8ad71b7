"""Causes at the tool."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Self

from palpate.effects.base import MEASURE_SIZE, Effect, Slot
from palpate.effects.family import TOOL
from palpate.effects.linearisation import Linearisation, Measurement, NuisanceBlock
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.bounds import TOOL_RADII
from palpate.setup.setup import PAIRINGS, Setup

__all__ = ["LandmarkMismatch", "ToolCompliance", "ToolFriction", "ToolOffset", "ToolRadius"]


@dataclass(frozen=True, kw_only=True)
class ToolRadius(Effect):
    """A tool of another size than stated."""

    name, enters = "tool_radius", Slot.TOOL
    family = TOOL
    summary = "the tool has another size than stated"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.TOOL_RADIUS
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    # Measured: for a ball of 3.4 mm that is stated to have 5 mm the linear gain is 14 nats, that of
    # a compliant tool 282.
    strongly_nonlinear = True
    radius: float = parameter("m", low=TOOL_RADII[0], high=TOOL_RADII[1], scale=3e-4, accuracy=5e-5)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(radius=setup.tool.radius)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(radius=setup.tool.radius * factor) for factor in (0.82, 1.2)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, tool=replace(setup.tool, radius=self.radius))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return f"the size of the tool: its radius is {quantity(values['radius'], 'm')}"


@dataclass(frozen=True, kw_only=True)
class ToolOffset(Effect):
    """The tool's centre is not where the kinematics say, though the touches were right.

    The numbers are true minus stated position, phantom frame.
    """

    name, enters = "tool_offset", Slot.TOOL
    family = TOOL
    summary = "the tool's centre is not where the kinematics say"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.TOOL_POSITION
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    # Measured: of a shift of 2.4 mm the linear fit finds 0.4 mm.
    strongly_nonlinear = True
    dx: float = parameter("m", low=-5e-3, high=5e-3, scale=5e-4)
    dy: float = parameter("m", low=-5e-3, high=5e-3, scale=5e-4)
    dz: float = parameter("m", low=-5e-3, high=5e-3, scale=5e-4)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(dx=0.0, dy=0.0, dz=0.0)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Return the stated position; the directions follow from the sensitivities."""
        return [cls.neutral(setup)]

    def apply(self, setup: Setup) -> Setup:
        offset = setup.tool.offset
        return replace(
            setup,
            tool=replace(
                setup.tool, offset=(offset[0] + self.dx, offset[1] + self.dy, offset[2] + self.dz)
            ),
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        away = quantity(math.hypot(values["dx"], values["dy"], values["dz"]), "m")
        return f"that the tool's centre is {away} away from where the robot says"


@dataclass(frozen=True, kw_only=True)
class ToolCompliance(Effect):
    """The shaft or the cables yield under load: the true centre is the stated one plus C F."""

    name, enters = "tool_compliance", Slot.TOOL
    family = TOOL
    summary = "the tool gives way under load"
    linearisation = Linearisation.TANGENT
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    compliance_times_stiffness: float = parameter(
        "1/m", low=0.0, high=500.0, scale=3.0, accuracy=1.0
    )

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

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        compliance = values["compliance_times_stiffness"]
        return f"a tool that bends under load, C E = {compliance:.2g} per metre"


@dataclass(frozen=True, kw_only=True)
class ToolFriction(Effect):
    """The tool drags the surface along: Coulomb's friction with stick and slip."""

    name, enters = "tool_friction", Slot.TOOL
    summary = "the tool drags the surface along"
    linearisation = Linearisation.HISTORY
    # Measured: at a coefficient of 0.5 two engines and two grids drag the surface as far within
    # 3 %, the difference between 0.5 and 0.515.
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

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return (
            "that the tool drags the surface along, "
            f"with a friction coefficient of {values['friction_coefficient']:.2g}"
        )


@dataclass(frozen=True, kw_only=True)
class LandmarkMismatch(Effect):
    """Touches paired with the wrong landmarks, or made beside them.

    The tool is then where a registration to the right places puts it (see
    `palpate.measurement.touch_correction`). A touched polygon of another size about the same middle
    gives the same registration: `scale`, and `inset` at evenly spaced corners, show in the
    residuals of the touches, and in no replay.
    """

    name, enters = "landmark_mismatch", Slot.TOOL
    summary = "the touches were of other places than stated"
    linearisation, joint = Linearisation.TANGENT, True
    told_apart_by = MappingProxyType({"geometry_scale": MEASURE_SIZE})
    pairing: str = parameter("", choices=PAIRINGS)
    scale: float = parameter("1", low=0.6, high=1.6, scale=0.02)
    inset: float = parameter("m", low=-0.01, high=0.02, scale=5e-4)

    @classmethod
    def at_rest(cls) -> bool:
        """Return True: the touches are evidence themselves."""
        return True

    @classmethod
    def impossible(cls, setup: Setup) -> str:
        if setup.tracing is not None:
            return "the robot was registered by traces, and no touch was paired with a landmark"
        return super().impossible(setup)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        here = setup.touching
        return cls(pairing=here.pairing, scale=here.scale, inset=here.inset)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Return every other pairing, and the stated one with touches inside the corners."""
        others = [cls(pairing=pairing, scale=1.0, inset=0.0) for pairing in PAIRINGS[1:]]
        return [
            *others,
            cls(pairing=PAIRINGS[0], scale=0.85, inset=0.0),
            cls(pairing=PAIRINGS[0], scale=1.0, inset=3e-3),
        ]

    @classmethod
    def of_touches(cls, pairing: str) -> Self:
        return cls(pairing=pairing, scale=1.0, inset=0.0)

    def apply(self, setup: Setup) -> Setup:
        touching = replace(setup.touching, pairing=self.pairing, scale=self.scale, inset=self.inset)
        return replace(setup, touching=touching)

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        side = "inside" if values["inset"] >= 0 else "outside"
        apart, inset = (
            f"{values['scale']:.3g} times as far apart",
            quantity(abs(values["inset"]), "m"),
        )
        parts = [_paired(str(values["pairing"])), f"{apart}, {inset} {side}"]
        return (
            "that the touches were of other places than stated: "
            f"{', '.join(part for part in parts if part)}"
        )


def _paired(pairing: str) -> str:
    """The true pairing of touches in words, by the rows of touches.csv; empty if as stated."""
    kind, *rows = pairing.split("-")
    if kind == "swap":
        return f"rows {rows[0]} and {rows[1]} were taken for each other"
    if kind == "turn":
        return f"each row is of the landmark {rows[0]} further on"
    return "the rows are in the reverse order" if kind == "reversed" else ""
