"""The effects that the virtual bench can hide."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from palpate.synthetic.scenario.parameter_names import check_named

__all__ = ["HIDDEN", "QUICK", "WEIGHED", "HiddenEffect"]

HIDDEN: Mapping[str, Mapping[str, str]] = {
    "poisson_ratio": {"nu": "1"},
    "stiff_inclusion": {"x": "m", "y": "m", "z": "m", "radius": "m", "stiffness_ratio": "1"},
    "tool_radius": {"radius": "m"},
    "tool_offset": {"dx": "m", "dy": "m", "dz": "m"},
    "base_slip": {"friction_coefficient": "1"},
    "base_detachment": {"edge": "", "extent": "m"},
    "gravity": {"specific_weight_over_stiffness": "1/m"},
    "time_offset": {"offset": "s"},
    "camera_registration": {"translation": "m", "rotation": "rad"},
    "surface_layer": {"thickness": "m", "stiffness_ratio": "1"},
    "stiffness_gradient": {"log_ratio": "1"},
    "strain_stiffening": {"J_m": "1"},
    "anisotropy": {"direction": "rad", "stiffness_ratio": "1"},
    "base_compliance": {"stiffness_over_E": "1/m"},
    "tool_compliance": {"compliance_times_stiffness": "1/m"},
    "young_modulus": {"E": "Pa"},
    "depth_bias": {"offset": "m", "scale": "1"},
    "geometry_scale": {"scale_x": "1", "scale_y": "1", "scale_z": "1"},
    "landmark_mismatch": {"pairing": "", "scale": "1", "inset": "m"},
    "viscoelasticity": {"relaxed_fraction": "1", "time_constant": "s"},
    "permanent_set": {"retained_fraction": "1"},
    "tool_friction": {"friction_coefficient": "1"},
    "stiff_tube": {
        "aside": "m",
        "z": "m",
        "heading": "rad",
        "inclination": "rad",
        "bend": "1/m",
        "sag": "1/m",
        "radius": "m",
        "stiffness_ratio": "1",
    },
    "geometry_local": {"rms": "m"},
}
"""The effects that the virtual bench can hide, with the unit of each parameter; names are those of
the catalogue."""

WEIGHED = tuple(
    name for name in HIDDEN if name not in ("young_modulus", "stiff_tube", "geometry_local")
)
"""The effects that suites draw from. They show in clouds alone; a block of any modulus takes the
same shape. A tube and a cast's own form are hidden where they are asked for, so that a seed draws
what it always drew."""

QUICK = (
    "poisson_ratio",
    "stiff_inclusion",
    "tool_radius",
    "tool_offset",
    "base_slip",
    "base_detachment",
    "gravity",
    "time_offset",
    "camera_registration",
    "surface_layer",
    "stiffness_gradient",
    "strain_stiffening",
    "anisotropy",
    "base_compliance",
    "tool_compliance",
)
"""The effects that are drawn by default; a material with a history, or friction at the tool, takes
minutes to simulate."""


@dataclass(frozen=True)
class HiddenEffect:
    """One hidden cause.

    Attributes:
        effect: name in the catalogue.
        parameters: by name, SI units; an edge and a pairing are words.
        second_law: whether it follows its second law (`palpate.synthetic.laws`).
    """

    effect: str
    parameters: Mapping[str, float | str] = field(default_factory=dict)
    second_law: bool = False

    def __post_init__(self) -> None:
        check_named(self.effect, self.parameters, HIDDEN, "hide")

    def value(self, name: str) -> float:
        """The numeric parameter of this name."""
        return float(self.parameters[name])
