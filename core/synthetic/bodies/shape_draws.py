"""Random hidden effects of clear sizes in a free form."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.bodies.shape_pushes import reachable_places
from palpate.synthetic.laws.support_laws import side_of
from palpate.synthetic.scenario.hidden_effects import HIDDEN, HiddenEffect
from palpate.synthetic.scenario.scenario_draws import CLEAR, Draw, between, draw_scenario, either

__all__ = ["ON_SHAPES", "QUICK_ON_SHAPES", "draw_in_shape", "point_above"]

ON_SHAPES = tuple(
    name for name in HIDDEN if name not in ("young_modulus", "landmark_mismatch", "tool_friction")
)
"""Effects that the bench can hide in a free form. A modulus alone does not show without a measured
force, and friction at the tool not in pushes along the normal: measured, its limit on a kidney is a
coefficient of 1.4. Touches are mistaken for each other on a block only."""
QUICK_ON_SHAPES = (
    "poisson_ratio",
    "stiff_inclusion",
    "tool_radius",
    "tool_offset",
    "gravity",
    "time_offset",
    "camera_registration",
    "surface_layer",
    "stiffness_gradient",
    "strain_stiffening",
    "base_compliance",
    "tool_compliance",
    "depth_bias",
    "geometry_scale",
)
"""The effects that are drawn by default; a material with a history takes minutes to simulate."""
_THICK = 0.75
"""Least height of the surface above a lump over the body's height [1]."""
_LARGEST_LUMP = 0.36
"""Largest radius of a lump over the height of the surface above it [1]."""
_LOOSE, _MOST_LOOSE = (0.42, 0.5), 0.0385
"""Extent of a detached strip over the body's length [1], and its largest value [m]."""


def draw_in_shape(
    shape: Shape, effects: int, seed: int, among: tuple[str, ...] = QUICK_ON_SHAPES
) -> tuple[HiddenEffect, ...]:
    """Draw hidden effects of clear sizes.

    Args:
        shape: as its file states it.
        effects: number of different ones.
        seed: of everything random.
        among: effects to draw from.
    """
    rng = np.random.default_rng([seed, 41])
    drawn = draw_scenario(seed, effects, among=among, draws=_clear_in(shape)).effects
    sizes = next((one for one in drawn if one.effect == "geometry_scale"), None)
    true = (
        shape.scaled(np.array([sizes.value(f"scale_{axis}") for axis in "xyz"])) if sizes else shape
    )
    placed = {"stiff_inclusion": _lump, "stiff_tube": _tube}
    return tuple(placed[one.effect](true, rng) if one.effect in placed else one for one in drawn)


def _clear_in(shape: Shape) -> Mapping[str, Draw]:
    """Draws of clear effects: those of a block, and larger ones where a free form shows less.

    Measured on a kidney under five sequences of three pushes: those of a block are 0.4 to 1.5
    detection limits for the effects below, and two and more for the others.
    """
    return {
        **CLEAR,
        "tool_offset": _offset,
        "base_detachment": lambda rng: _strip(shape, rng),
        "gravity": lambda rng: {"specific_weight_over_stiffness": between(rng, 3.0, 4.5, 2)},
        "time_offset": lambda rng: {
            "offset": either(rng, (0.12, 0.25), (-0.25, -0.12), decimals=3)
        },
        "surface_layer": lambda rng: {
            "thickness": between(rng, 2.5e-3, 4.5e-3),
            "stiffness_ratio": between(rng, 8.0, 14.0, 1),
        },
        "stiffness_gradient": lambda rng: {
            "log_ratio": either(rng, (-2.4, -1.6), (1.6, 2.4), decimals=2)
        },
        "strain_stiffening": lambda rng: {"J_m": between(rng, 0.65, 1.0, 2)},
        "tool_compliance": lambda rng: {"compliance_times_stiffness": between(rng, 36.0, 55.0, 1)},
        "geometry_scale": _sizes,
    }


def _offset(rng: np.random.Generator) -> dict[str, float | str]:
    direction = rng.normal(size=3)
    step = direction / np.linalg.norm(direction) * rng.uniform(2.2e-3, 3.5e-3)
    return {
        name: round(float(part), 5) for name, part in zip(("dx", "dy", "dz"), step, strict=True)
    }


def _strip(shape: Shape, rng: np.random.Generator) -> dict[str, float | str]:
    edge = str(rng.choice(["-x", "+x", "-y", "+y"]))
    length = float(shape.size[side_of(edge)[0]])
    return {"edge": edge, "extent": round(min(between(rng, *_LOOSE) * length, _MOST_LOOSE), 4)}


def _sizes(rng: np.random.Generator) -> dict[str, float | str]:
    wide = {name: between(rng, 0.95, 1.05, 3) for name in ("scale_x", "scale_y")}
    return {**wide, "scale_z": either(rng, (0.91, 0.945), (1.055, 1.09), decimals=3)}


def _lump(shape: Shape, rng: np.random.Generator) -> HiddenEffect:
    """Draw a stiff ball close under the upper part of the surface, which shows on it."""
    places, normals = reachable_places(shape, "poke-top", point_above(shape), 5e-3)
    high = np.flatnonzero(places[:, 2] > _THICK * shape.height)
    row = int(rng.choice(high))
    radius = min(float(rng.uniform(8e-3, 10e-3)), _LARGEST_LUMP * float(places[row, 2]))
    centre = places[row] - normals[row] * (radius + rng.uniform(1.2e-3, 2.2e-3))
    values = {name: round(float(value), 5) for name, value in zip("xyz", centre, strict=True)}
    ratio = round(float(rng.uniform(8.0, 14.0)), 2)
    return HiddenEffect(
        "stiff_inclusion", {**values, "radius": round(radius, 5), "stiffness_ratio": ratio}
    )


def _tube(shape: Shape, rng: np.random.Generator) -> HiddenEffect:
    """Draw a stiff tube, curved a little, close under the upper part of the surface."""
    places, normals = reachable_places(shape, "poke-top", point_above(shape), 5e-3)
    row = int(rng.choice(np.flatnonzero(places[:, 2] > _THICK * shape.height)))
    radius = float(rng.uniform(3.8e-3, 5e-3))
    point = places[row] - normals[row] * (radius + rng.uniform(1.5e-3, 2.5e-3))
    heading, bend = float(rng.uniform(-1.5, 1.5)), float(rng.uniform(-6.0, 6.0))
    sag = float(rng.uniform(-6.0, 0.0))
    along = np.array([np.cos(heading), np.sin(heading)])
    left = np.array([-along[1], along[0]])
    tilt = float(np.clip(-(normals[row, :2] @ along) / normals[row, 2], -0.4, 0.4))
    away = point[:2] - (shape.low + shape.high)[:2] / 2
    way = float(away @ along)
    values = {
        "aside": round(float(away @ left) - bend * way**2 / 2, 5),
        # The slope is `tilt` under the place, and not where the axis is nearest to the middle.
        "z": round(float(point[2]) - tilt * way + sag * way**2 / 2, 5),
        "heading": round(heading, 4),
        "inclination": round(float(np.arctan(tilt - sag * way)), 4),
        "bend": round(bend, 3),
        "sag": round(sag, 3),
        "radius": round(radius, 5),
        "stiffness_ratio": round(float(rng.uniform(10.0, 20.0)), 2),
    }
    return HiddenEffect("stiff_tube", values)


def point_above(shape: Shape) -> FloatArray:
    """A point (3,) [m] far above the body."""
    return np.array([*(0.5 * (shape.low + shape.high))[:2], shape.height + 1.0])
