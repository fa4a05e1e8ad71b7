"""The catalogue of causes. A new one is one class in a file of this folder and one entry here.

The engine replays all of them. A diagnosis weighs those in `DIAGNOSED`: those that the virtual
bench can hide and whose signature it can screen, relaxation, permanent set and friction of the tool
among them by traces (`palpate.diagnosis.forward.history_columns`), and what other packages bring
(`OUTSIDE`; how is in the README beside this file).
"""

from __future__ import annotations

from typing import Any

from palpate.effects.base import Effect, Slot
from palpate.effects.elastic_material import PoissonRatio, StiffInclusion, YoungModulus
from palpate.effects.geometry import GeometryScale, MeshResolution
from palpate.effects.heterogeneity import (
    Anisotropy,
    StiffnessGradient,
    StrainStiffening,
    SurfaceLayer,
)
from palpate.effects.linearisation import Linearisation, Measurement, NuisanceBlock, Tangent
from palpate.effects.load import Gravity
from palpate.effects.parameter import Parameter, parameter
from palpate.effects.plugins import outside_effects
from palpate.effects.sensor import CameraRegistration, DepthBias, TimeOffset
from palpate.effects.support import BaseCompliance, BaseDetachment, BaseSlip
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity
from palpate.effects.tool import (
    LandmarkMismatch,
    ToolCompliance,
    ToolFriction,
    ToolOffset,
    ToolRadius,
)
from palpate.foundation.errors import EffectError

__all__ = [
    "CATALOGUE",
    "DIAGNOSED",
    "OUTSIDE",
    "Effect",
    "Linearisation",
    "Measurement",
    "NuisanceBlock",
    "Parameter",
    "Slot",
    "Tangent",
    "effect_named",
    "from_json",
    "parameter",
]

_COUNTED: tuple[type[Effect], ...] = (
    PoissonRatio,
    StiffInclusion,
    ToolRadius,
    ToolOffset,
    BaseSlip,
    BaseDetachment,
    Gravity,
    TimeOffset,
    CameraRegistration,
    SurfaceLayer,
    StiffnessGradient,
    StrainStiffening,
    Anisotropy,
    BaseCompliance,
    ToolCompliance,
    Viscoelasticity,
    PermanentSet,
    ToolFriction,
    DepthBias,
    GeometryScale,
    LandmarkMismatch,
    MeshResolution,
)
_REPLAYED: tuple[type[Effect], ...] = (YoungModulus,)
OUTSIDE = outside_effects(effect.name for effect in (*_COUNTED, *_REPLAYED))
DIAGNOSED = (*_COUNTED, *OUTSIDE)
CATALOGUE = (*DIAGNOSED, *_REPLAYED)


def effect_named(name: str) -> type[Effect]:
    """The class of this name; an unknown one is an error that lists the known."""
    for effect in CATALOGUE:
        if effect.name == name:
            return effect
    raise EffectError(
        f"no effect is called {name!r}; known are {', '.join(e.name for e in CATALOGUE)}",
        parameter=name,
    )


def from_json(data: dict[str, Any]) -> Effect:
    """The inverse of `Effect.to_json`."""
    return effect_named(data["effect"])(**data["parameters"])
