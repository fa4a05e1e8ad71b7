"""One of each effect that changes what a replay finds, neither weak nor at a bound."""

from __future__ import annotations

from palpate.effects import Effect
from palpate.effects.elastic_material import PoissonRatio, StiffInclusion
from palpate.effects.heterogeneity import (
    Anisotropy,
    StiffnessGradient,
    StiffTube,
    StrainStiffening,
    SurfaceLayer,
)
from palpate.effects.load import Gravity
from palpate.effects.support import BaseCompliance, BaseDetachment
from palpate.effects.tool import ToolCompliance, ToolOffset, ToolRadius

DEFORMING: dict[str, Effect] = {
    "poisson_ratio": PoissonRatio(nu=0.43),
    "stiff_inclusion": StiffInclusion(x=4e-3, y=1e-3, z=0.022, radius=8e-3, stiffness_ratio=3.0),
    "tool_radius": ToolRadius(radius=5.2e-3),
    "tool_offset": ToolOffset(dx=2e-4, dy=-2.2e-4, dz=1e-4),
    "base_detachment": BaseDetachment(edge="+x", extent=0.02),
    "gravity": Gravity(specific_weight_over_stiffness=1.5),
    "surface_layer": SurfaceLayer(thickness=3e-3, stiffness_ratio=4.0),
    "stiffness_gradient": StiffnessGradient(log_ratio=0.5),
    "strain_stiffening": StrainStiffening(J_m=4.0),
    "anisotropy": Anisotropy(direction=0.4, stiffness_ratio=3.0),
    "base_compliance": BaseCompliance(stiffness_over_E=60.0),
    "stiff_tube": StiffTube(
        aside=2e-3,
        z=0.026,
        heading=0.4,
        inclination=0.1,
        bend=6.0,
        sag=-3.0,
        radius=5e-3,
        stiffness_ratio=4.0,
    ),
    "tool_compliance": ToolCompliance(compliance_times_stiffness=20.0),
}
