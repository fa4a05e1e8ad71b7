"""Effects: one class for each cause of an error, and the catalogue of them (`catalogue.py`)."""

from __future__ import annotations

from palpate.effects.base import Effect, Slot
from palpate.effects.elastic_material import PoissonRatio, StiffInclusion, YoungModulus
from palpate.effects.geometry import GeometryScale, MeshResolution
from palpate.effects.heterogeneity import (
    Anisotropy,
    StiffnessGradient,
    StiffTube,
    StrainStiffening,
    SurfaceLayer,
)
from palpate.effects.linearisation import Linearisation, Measurement, NuisanceBlock, Tangent
from palpate.effects.load import Gravity
from palpate.effects.parameter import Parameter, parameter
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

# isort: split
# Effects of other packages import from here while the catalogue is made, so it comes last.
from palpate.effects.catalogue import CATALOGUE, DIAGNOSED, OUTSIDE, effect_named, from_json

__all__ = [
    "CATALOGUE",
    "DIAGNOSED",
    "OUTSIDE",
    "Anisotropy",
    "BaseCompliance",
    "BaseDetachment",
    "BaseSlip",
    "CameraRegistration",
    "DepthBias",
    "Effect",
    "GeometryScale",
    "Gravity",
    "LandmarkMismatch",
    "Linearisation",
    "Measurement",
    "MeshResolution",
    "NuisanceBlock",
    "Parameter",
    "PermanentSet",
    "PoissonRatio",
    "Slot",
    "StiffInclusion",
    "StiffTube",
    "StiffnessGradient",
    "StrainStiffening",
    "SurfaceLayer",
    "Tangent",
    "TimeOffset",
    "ToolCompliance",
    "ToolFriction",
    "ToolOffset",
    "ToolRadius",
    "Viscoelasticity",
    "YoungModulus",
    "effect_named",
    "from_json",
    "parameter",
]
