"""The catalogue of causes. A new one is one class in a file of this folder and one entry here.

The engine replays all of them. A diagnosis weighs those in `DIAGNOSED`, for which its false alarms were counted.
"""

from __future__ import annotations

from typing import Any

from core.effects.base import Effect, Parameter, Slot
from core.effects.load import Gravity
from core.effects.material import PoissonRatio, StiffInclusion
from core.effects.memory import PermanentSet, Viscoelasticity
from core.effects.sensor import CameraRegistration, TimeOffset
from core.effects.structure import Anisotropy, StiffnessGradient, StrainStiffening, SurfaceLayer
from core.effects.support import BaseCompliance, BaseDetachment, BaseSlip
from core.effects.tool import ToolCompliance, ToolFriction, ToolOffset, ToolRadius
from core.errors import EffectError

__all__ = ["CATALOGUE", "DIAGNOSED", "Effect", "Parameter", "Slot", "effect_named", "from_json"]

DIAGNOSED: tuple[type[Effect], ...] = (
    PoissonRatio,
    StiffInclusion,
    ToolRadius,
    ToolOffset,
    BaseSlip,
    BaseDetachment,
    Gravity,
    TimeOffset,
    CameraRegistration,
)
CATALOGUE: tuple[type[Effect], ...] = (
    *DIAGNOSED,
    SurfaceLayer,
    StiffnessGradient,
    StrainStiffening,
    Anisotropy,
    Viscoelasticity,
    PermanentSet,
    BaseCompliance,
    ToolCompliance,
    ToolFriction,
)


def effect_named(name: str) -> type[Effect]:
    """The class of this name; an unknown one is an error that lists the known."""
    for effect in CATALOGUE:
        if effect.name == name:
            return effect
    raise EffectError(f"no effect is called {name!r}; known are {', '.join(e.name for e in CATALOGUE)}", parameter=name)


def from_json(data: dict[str, Any]) -> Effect:
    """The inverse of `Effect.to_json`."""
    return effect_named(data["effect"])(**data["parameters"])
