"""Random scenarios: hidden effects of clear and of subtle sizes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from palpate.foundation.errors import EffectError
from palpate.synthetic.scenario.hidden_effects import HIDDEN, QUICK, HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario

__all__ = ["CLEAR", "Draw", "between", "draw_scenario", "either"]

Draw = Callable[[np.random.Generator], dict[str, float | str]]


def between(rng: np.random.Generator, low: float, high: float, decimals: int = 4) -> float:
    """Draw a rounded number from a range."""
    return round(float(rng.uniform(low, high)), decimals)


def either(rng: np.random.Generator, *ranges: tuple[float, float], decimals: int = 4) -> float:
    """Draw a rounded number from one of several ranges."""
    low, high = ranges[int(rng.integers(len(ranges)))]
    return between(rng, low, high, decimals)


def _inclusion(rng: np.random.Generator) -> dict[str, float | str]:
    radius = between(rng, 6.5e-3, 9e-3)
    return {
        "x": between(rng, -0.018, 0.018),
        "y": between(rng, -0.006, 0.006),
        "z": round(0.0358 - radius - between(rng, 1.5e-3, 4e-3), 4),
        "radius": radius,
        "stiffness_ratio": between(rng, 4.0, 10.0, 1),
    }


def _tube(rng: np.random.Generator) -> dict[str, float | str]:
    radius = between(rng, 2.8e-3, 4e-3)
    return {
        "aside": between(rng, -7e-3, 7e-3),
        "z": round(0.0358 - radius - between(rng, 2e-3, 4e-3), 4),
        "heading": between(rng, -1.5, 1.5, 3),
        "inclination": between(rng, -0.08, 0.08, 3),
        "bend": either(rng, (-7.0, -3.0), (3.0, 7.0), decimals=2),
        "sag": between(rng, -4.0, 1.0, 2),
        "radius": radius,
        "stiffness_ratio": between(rng, 8.0, 20.0, 1),
    }


def _stretch(rng: np.random.Generator) -> dict[str, float | str]:
    return {
        "offset": between(rng, -3e-3, 3e-3, 5),
        "scale": either(rng, (0.955, 0.97), (1.03, 1.045)),
    }


def _sizes(rng: np.random.Generator) -> dict[str, float | str]:
    wide = {name: between(rng, 0.95, 1.05, 3) for name in ("scale_x", "scale_y")}
    return {**wide, "scale_z": either(rng, (0.93, 0.965), (1.035, 1.07), decimals=3)}


def _mismatch(rng: np.random.Generator) -> dict[str, float | str]:
    """Swapped corners and a polygon that is too small, as in the public recordings."""
    pairing = str(
        rng.choice(["as-paired", "swap-1-2", "swap-1-3", "swap-2-4", "swap-3-4", "turn-1"])
    )
    return {
        "pairing": pairing,
        "scale": between(rng, 0.82, 0.9, 3),
        "inset": between(rng, 0.5e-3, 2e-3),
    }


def _offset(rng: np.random.Generator) -> dict[str, float | str]:
    direction = rng.normal(size=3)
    step = direction / np.linalg.norm(direction) * rng.uniform(1.2e-3, 2.5e-3)
    return {
        name: round(float(part), 5) for name, part in zip(("dx", "dy", "dz"), step, strict=True)
    }


CLEAR: Mapping[str, Draw] = {
    "poisson_ratio": lambda rng: {"nu": between(rng, 0.08, 0.3, 3)},
    "stiff_inclusion": _inclusion,
    "tool_radius": lambda rng: {"radius": either(rng, (3.0e-3, 3.8e-3), (6.2e-3, 7.4e-3))},
    "tool_offset": _offset,
    # Measured in 30 motions: the fitted push from the side slides below 0.164 to 0.234. A base that
    # sticks in it would show nothing.
    "base_slip": lambda rng: {"friction_coefficient": between(rng, 0.08, 0.15, 3)},
    "base_detachment": lambda rng: {
        "edge": str(rng.choice(["-x", "+x", "-y", "+y"])),
        "extent": between(rng, 10e-3, 20e-3),
    },
    # A gel of 5 kPa has 2 per metre; below 1.5 the sag is within the camera's bias of 0.3 mm.
    "gravity": lambda rng: {"specific_weight_over_stiffness": between(rng, 1.9, 3.0, 2)},
    "time_offset": lambda rng: {"offset": either(rng, (0.08, 0.25), (-0.25, -0.08), decimals=3)},
    "camera_registration": lambda rng: {
        "translation": between(rng, 2.5e-3, 6e-3),
        "rotation": between(rng, 0.03, 0.07),
    },
    "surface_layer": lambda rng: {
        "thickness": between(rng, 2e-3, 4e-3),
        "stiffness_ratio": between(rng, 5.0, 12.0, 1),
    },
    "stiffness_gradient": lambda rng: {
        "log_ratio": either(rng, (-2.0, -1.2), (1.2, 2.0), decimals=2)
    },
    "strain_stiffening": lambda rng: {"J_m": between(rng, 0.8, 1.6, 2)},
    # Stronger fibres kink where a push from the side presses them together.
    "anisotropy": lambda rng: {
        "direction": between(rng, 0.0, 3.14, 3),
        "stiffness_ratio": between(rng, 2.5, 4.0, 2),
    },
    "base_compliance": lambda rng: {"stiffness_over_E": between(rng, 20.0, 50.0, 1)},
    "tool_compliance": lambda rng: {"compliance_times_stiffness": between(rng, 20.0, 45.0, 1)},
    "young_modulus": lambda rng: {"E": either(rng, (2.5e3, 3.6e3), (6.9e3, 10e3), decimals=0)},
    # The apparent error of the top's height is a millimetre and more.
    "depth_bias": _stretch,
    "geometry_scale": _sizes,
    "landmark_mismatch": _mismatch,
    "viscoelasticity": lambda rng: {
        "relaxed_fraction": between(rng, 0.4, 0.7, 3),
        "time_constant": between(rng, 0.4, 2.5, 2),
    },
    "permanent_set": lambda rng: {"retained_fraction": between(rng, 0.12, 0.3, 3)},
    "tool_friction": lambda rng: {"friction_coefficient": between(rng, 0.3, 0.8, 3)},
    "stiff_tube": _tube,
    "geometry_local": lambda rng: {"rms": between(rng, 0.35e-3, 0.6e-3, 6)},
}
"""Draws of the parameters of a clear effect in a block, SI units."""


def draw_scenario(
    seed: int,
    effects: int = 1,
    clear: bool = True,
    among: Sequence[str] = QUICK,
    draws: Mapping[str, Draw] = CLEAR,
) -> Scenario:
    """Draw a scenario; EffectError where one of `among` is not in HIDDEN.

    Args:
        seed: of everything random.
        effects: number of different hidden effects.
        clear: whether sizes are well above the sensor's noise. Otherwise each effect is nearer to
            its neutral value, so that most are two to five times the detection limit of the short
            protocol.
        among: effects to draw from.
        draws: of the parameters of a clear effect.
    """
    if unknown := [name for name in among if name not in HIDDEN]:
        raise EffectError(
            f"the virtual bench cannot hide {unknown[0]!r}; it knows {', '.join(HIDDEN)}",
            effect=unknown[0],
        )
    rng = np.random.default_rng([seed, 7919])
    names = rng.choice(list(among), size=effects, replace=False)
    hidden = tuple(HiddenEffect(str(name), draws[str(name)](rng)) for name in names)
    return Scenario(effects=hidden if clear else tuple(_fainter(one) for one in hidden))


_NEUTRAL: Mapping[str, float] = {
    "nu": 0.45,
    "tool_radius": 0.005,
    "stiffness_ratio": 1.0,
    "E": 5e3,
    "scale": 1.0,
    "scale_x": 1.0,
    "scale_y": 1.0,
    "scale_z": 1.0,
}
_SHRINKING = (
    "dx",
    "dy",
    "dz",
    "extent",
    "specific_weight_over_stiffness",
    "offset",
    "translation",
    "rotation",
    "log_ratio",
    "compliance_times_stiffness",
    "inset",
    "relaxed_fraction",
    "retained_fraction",
    "friction_coefficient",
    "rms",
)
_GROWING = ("J_m", "stiffness_over_E")
"""Parameters that are neutral at infinity; the strength of the effect goes with their inverse."""


_FAINTNESS: Mapping[str, float] = {
    "poisson_ratio": 0.8,
    "tool_radius": 0.6,
    "tool_offset": 0.9,
    "base_slip": 0.8,
    "base_detachment": 0.75,
    "gravity": 0.5,
    "time_offset": 0.4,
    "camera_registration": 0.6,
    "stiffness_gradient": 0.5,
    "anisotropy": 0.25,
    "base_compliance": 0.2,
    "tool_compliance": 0.7,
    "depth_bias": 0.5,
    "geometry_scale": 0.45,
    "tool_friction": 0.4,
}
"""Deviation from neutral of a subtle effect over that of a clear one [1]; a third for others.
Derived from the detection limits in `benchmarks/blind/calibration-301.jsonl`."""


def _fainter(hidden: HiddenEffect) -> HiddenEffect:
    parameters, share = dict(hidden.parameters), _FAINTNESS.get(hidden.effect, 1 / 3)
    for name, value in parameters.items():
        key = hidden.effect if hidden.effect == "tool_radius" else name
        if key in _NEUTRAL:
            parameters[name] = round(_NEUTRAL[key] + (float(value) - _NEUTRAL[key]) * share, 6)
        elif name in _GROWING or hidden.effect == "base_slip":
            parameters[name] = round(float(value) / share, 6)
        elif name in _SHRINKING:
            parameters[name] = round(float(value) * share, 6)
        elif name == "pairing":
            parameters[name] = "as-paired"
    return HiddenEffect(hidden.effect, parameters)
