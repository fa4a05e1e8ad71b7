"""The catalogue of effects. A new one is one class in a module of this package and one entry here.

The engine replays all of them. A diagnosis weighs those of `DIAGNOSED` that the data can show, and
the modulus where forces were measured. `OUTSIDE` are the effects of other packages (see the README
beside this file).
"""

from __future__ import annotations

from typing import Any

from palpate.effects.base import Effect
from palpate.effects.elastic_material import PoissonRatio, StiffInclusion, YoungModulus
from palpate.effects.geometry import GeometryLocal, GeometryScale, MeshResolution
from palpate.effects.heterogeneity import (
    Anisotropy,
    StiffnessGradient,
    StiffTube,
    StrainStiffening,
    SurfaceLayer,
)
from palpate.effects.load import Gravity
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

__all__ = ["CATALOGUE", "DIAGNOSED", "OUTSIDE", "effect_named", "from_json"]

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
    StiffTube,
    GeometryLocal,
)
_REPLAYED: tuple[type[Effect], ...] = (YoungModulus,)
OUTSIDE = outside_effects(effect.name for effect in (*_COUNTED, *_REPLAYED))
DIAGNOSED = (*_COUNTED, *OUTSIDE)
CATALOGUE = (*DIAGNOSED, *_REPLAYED)


def effect_named(name: str) -> type[Effect]:
    """Return the class of this name; raise EffectError that lists the known names otherwise."""
    for effect in CATALOGUE:
        if effect.name == name:
            return effect
    raise EffectError(
        f"no effect is called {name!r}; known are {', '.join(e.name for e in CATALOGUE)}",
        parameter=name,
    )


def from_json(data: dict[str, Any]) -> Effect:
    """Return the effect that `Effect.to_json` described."""
    return effect_named(data["effect"])(**data["parameters"])
