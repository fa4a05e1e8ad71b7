"""Causes as noun phrases, one for each effect of the catalogue."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from palpate.app.reporting.quantities import quantity, with_interval, words

__all__ = ["cause_phrase"]

Values = dict[str, float]
SIDES = {
    "-x": "the left short side",
    "+x": "the right short side",
    "-y": "the front side",
    "+y": "the back side",
}


def cause_phrase(cause: dict[str, Any], size: Sequence[float] | None = None) -> str:
    """One cause as a noun phrase; `size` as in `verdict_sentence`."""
    values = {name: entry.get("value") for name, entry in cause.get("parameters", {}).items()}
    phrase = PHRASES.get(cause["effect"])
    if cause["effect"] == "stiff_inclusion" and "depth" in cause:
        return _felt_lump(cause, values)
    try:
        return phrase(values, size) if phrase else f"an effect called {words(cause['effect'])}"
    except (KeyError, TypeError):
        return f"an effect called {words(cause['effect'])}"


def _lump(values: Values, size: Sequence[float] | None) -> str:
    kind = "stiff" if values["stiffness_ratio"] >= 1.0 else "soft"
    place = "" if size is None else f", {quantity(size[2] - values['z'], 'm')} under the top"
    return f"a {kind} lump, {quantity(2 * values['radius'], 'm')} across{place}"


def _felt_lump(cause: dict[str, Any], values: Values) -> str:
    """A lump that was found from forces alone: its depth below the nearest skin."""
    kind = "stiff" if values["stiffness_ratio"] >= 1.0 else "soft"
    across, depth = quantity(2 * values["radius"], "m"), with_interval(cause["depth"])
    return f"a {kind} lump, {across} across, its centre {depth} under the surface"


def _shift(values: Values, _: Sequence[float] | None) -> str:
    distance = math.hypot(values["dx"], values["dy"], values["dz"])
    return f"that the tool's centre is {quantity(distance, 'm')} away from where the robot says"


def _camera(values: Values, _: Sequence[float] | None) -> str:
    turn = f" and {quantity(values['rotation'], 'rad')}" if values.get("rotation") else ""
    return (
        f"that the camera stands {quantity(values['translation'], 'm')}{turn} off its registration"
    )


def _late(values: Values, _: Sequence[float] | None) -> str:
    early = "late" if values["offset"] > 0 else "early"
    return f"that the camera's clock runs {quantity(abs(values['offset']), 's')} {early}"


def _fibres(values: Values, _: Sequence[float] | None) -> str:
    stiffer = f"{values['stiffness_ratio']:.2g} times as stiff along one direction as across"
    angle = quantity(values["direction"], "rad")
    return f"fibres: the phantom is {stiffer}, {angle} from its long side"


def _relaxing(values: Values, _: Sequence[float] | None) -> str:
    share, time = 100 * values["relaxed_fraction"], quantity(values["time_constant"], "s")
    return (
        f"that the material relaxes, by {share:.0f} % of its stiffness "
        f"with a time constant of {time}"
    )


def _gradient(values: Values, _: Sequence[float] | None) -> str:
    ratio = values["log_ratio"]
    where, other = ("top", "base") if ratio >= 0 else ("base", "top")
    factor = f"{math.exp(abs(ratio)):.2g}"
    return (
        "that the stiffness changes with the height: "
        f"the {where} is {factor} times as stiff as the {other}"
    )


def _paired(pairing: str) -> str:
    """The true pairing of touches, by the rows of touches.csv."""
    kind, *rows = pairing.split("-")
    if kind == "swap":
        return f"rows {rows[0]} and {rows[1]} were taken for each other"
    if kind == "turn":
        return f"each row is of the landmark {rows[0]} further on"
    return "the rows are in the reverse order" if kind == "reversed" else ""


def _beside(values: Values, _: Sequence[float] | None) -> str:
    side = "inside" if values["inset"] >= 0 else "outside"
    size = f"{values['scale']:.3g} times as far apart, {quantity(abs(values['inset']), 'm')} {side}"
    parts = [part for part in (_paired(str(values["pairing"])), size) if part]
    return f"that the touches were of other places than stated: {', '.join(parts)}"


def _size(values: Values, _: Sequence[float] | None) -> str:
    return (
        "another size of the phantom: "
        + " × ".join(f"{values[f'scale_{axis}']:.3g}" for axis in "xyz")
        + " of the stated one"
    )


PHRASES: dict[str, Callable[[Any, Sequence[float] | None], str]] = {
    "stiff_inclusion": _lump,
    "tool_offset": _shift,
    "camera_registration": _camera,
    "time_offset": _late,
    "poisson_ratio": lambda v, _: f"another compressibility: Poisson's ratio is {v['nu']:.3g}",
    "tool_radius": lambda v, _: f"the size of the tool: its radius is {quantity(v['radius'], 'm')}",
    "base_slip": lambda v, _: (
        "that the base slides on the table, "
        f"with a friction coefficient of {v['friction_coefficient']:.2g}"
    ),
    "base_detachment": lambda v, _: (
        f"that the base is loose {quantity(v['extent'], 'm')} inwards from {SIDES[v['edge']]}"
    ),
    "gravity": lambda v, _: (
        f"the phantom's own weight, ρg/E = {v['specific_weight_over_stiffness']:.2g} per metre"
    ),
    "surface_layer": lambda v, _: (
        f"a skin {quantity(v['thickness'], 'm')} thick, {v['stiffness_ratio']:.2g} times as stiff"
    ),
    "stiffness_gradient": _gradient,
    "strain_stiffening": lambda v, _: (
        f"that the material stiffens with strain, Gent's J_m = {v['J_m']:.2g}"
    ),
    "anisotropy": _fibres,
    "base_compliance": lambda v, _: (
        f"a compliant support, with springs of {v['stiffness_over_E']:.2g} E per metre"
    ),
    "tool_compliance": lambda v, _: (
        f"a tool that bends under load, C E = {v['compliance_times_stiffness']:.2g} per metre"
    ),
    "viscoelasticity": _relaxing,
    "permanent_set": lambda v, _: (
        f"that {100 * v['retained_fraction']:.0f} % of the deformation stays after release"
    ),
    "tool_friction": lambda v, _: (
        "that the tool drags the surface along, "
        f"with a friction coefficient of {v['friction_coefficient']:.2g}"
    ),
    "depth_bias": lambda v, _: (
        f"a camera that misreads depth, by {quantity(v['offset'], 'm')} and {v['scale']:.3g} times"
    ),
    "geometry_scale": _size,
    "landmark_mismatch": _beside,
    "mesh_resolution": lambda v, _: (
        f"a finer grid: the stated one is too coarse, {quantity(v['element_size'], 'm')} would do"
    ),
    "young_modulus": lambda v, _: f"another stiffness: Young's modulus is {quantity(v['E'], 'Pa')}",
}
