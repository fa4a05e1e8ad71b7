"""A report in words: the sentences of the terminal, the page and the HTML report."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from palpate.app.reporting.quantities import NARROW, quantity, with_interval, words

__all__ = [
    "cause_phrase",
    "control_sentences",
    "determined_sentences",
    "left_sentences",
    "limit_phrase",
    "palpation_sentences",
    "probe_sentence",
    "registration_sentences",
    "verdict_sentence",
]

Values = dict[str, float]
SIDES = {
    "-x": "the left short side",
    "+x": "the right short side",
    "-y": "the front side",
    "+y": "the back side",
}


def verdict_sentence(report: dict[str, Any], size: Sequence[float] | None = None) -> str:
    """The result of a diagnosis.

    Args:
        report: of the diagnosis.
        size: edge lengths (x, y, z) of the phantom [m]; with it depths below the top are given.
    """
    verdict = report.get("verdict")
    phrases = [cause_phrase(cause, size) for cause in report.get("causes", [])]
    if verdict == "replay":
        return f"Replayed with {_listed(phrases, 'and')}." if phrases else "Replayed as stated."
    if verdict == "none":
        return (
            "The simulation misses nothing that this data could show: what is left is noise and "
            "the stated accuracies."
        )
    if verdict == "unexplained":
        return "Structured error remains that no known effect removes."
    if verdict == "ambiguous":
        return f"Several causes explain the data equally well: {_listed(phrases, 'or')}."
    return f"The simulation misses {_listed(phrases, 'and')}{_gain(report)}."


def cause_phrase(cause: dict[str, Any], size: Sequence[float] | None = None) -> str:
    """One cause as a noun phrase; `size` as in `verdict_sentence`."""
    values = {name: entry.get("value") for name, entry in cause.get("parameters", {}).items()}
    phrase = PHRASES.get(cause["effect"])
    if cause["effect"] == "stiff_inclusion" and "depth" in cause:
        return _felt_lump(cause, values)
    try:
        return (
            phrase(values, size)
            if phrase
            else f"an effect called {cause['effect'].replace('_', ' ')}"
        )
    except (KeyError, TypeError):
        return f"an effect called {cause['effect'].replace('_', ' ')}"


def limit_phrase(row: dict[str, Any]) -> str:
    """Detection limit of an effect, from a row of the report's ambiguity map."""
    factors = [limit["factor"] for limit in row["limits"] if "factor" in limit]
    shares = [limit["share"] for limit in row["limits"] if "share" in limit]
    if None in (*factors, *shares, *(limit.get("change", 0.0) for limit in row["limits"])):
        return "not at any size"
    at = ", ".join(
        f"{name.replace('_', ' ')} {quantity(one['value'], one['unit'])}"
        for name, one in row["at"].items()
    )
    if factors and "x" not in row["at"]:  # has no place
        return f"{quantity(factors[0], '1')} times" + (f" at {at}" if at else "")
    if factors:
        typical = row["typical"]["factor"]
        spread = (
            "at half of the places not at any size"
            if typical is None
            else f"{quantity(typical, '1')} times at half of the places"
        )
        return f"{quantity(factors[0], '1')} times where it shows best, {spread}"
    if shares and row.get("effect") == "mesh_resolution":
        return f"{quantity(shares[0], '1')} times what the replay's grid and a finer one differ by"
    if shares:
        return f"{quantity(100 * shares[0], '1')}{NARROW}% of what {at} does"
    worst: dict[str, float] = {}
    for limit in row["limits"]:
        worst[limit["unit"]] = max(limit["change"], worst.get(limit["unit"], 0.0))
    return ", ".join(quantity(change, unit) for unit, change in worst.items())


def control_sentences(rows: Sequence[dict[str, Any]]) -> list[str]:
    """Results of the controls of each cause: one sentence on the passed ones, one on each failed
    one.
    """
    sentences = []
    for effect in dict.fromkeys(row["effect"] for row in rows):
        own, name = [row for row in rows if row["effect"] == effect], effect.replace("_", " ")
        passed = [row for row in own if row["passed"]]
        if passed:
            most = max(0.0, *(row["kept"] or 0.0 for row in passed))
            where = _listed([f"the {row['control']}" for row in passed], "or")
            sentences.append(
                f"with {where}, {name} keeps {100 * most:.0f}{NARROW}% of its gain at most"
            )
        for row in own:
            if row["passed"] is False:
                kept = f"still keeps {100 * row['kept']:.0f}{NARROW}% of its gain"
                sentences.append(
                    f"with the {row['control']}, {name} {kept}, "
                    "so that it may not come of the pushes"
                )
        if all(row["passed"] is None for row in own):
            sentences.append(
                f"none says anything of {name}: "
                + own[0].get("why", "it does not depend on the pushes")
            )
    return sentences


def probe_sentence(row: dict[str, Any]) -> str:
    """A row of the report's next probes: what to do, and which causes it separates."""
    apart = " from ".join(
        "nothing" if name == "none" else name.replace("_", " ") for name in row["separates"]
    )
    likely = row.get("probability")
    chance = ""
    if likely is not None:
        percent = "more than 99" if likely > 0.99 else f"{100 * likely:.0f}"
        chance = f", {percent}{NARROW}% likely to decide"
    return f"{row['text']}: tells {apart}{chance}"


def determined_sentences(causes: Sequence[dict[str, Any]]) -> list[str]:
    """The parameters of the causes that the data do not bound on both sides."""
    sentences = []
    for cause in causes:
        for name, entry in cause.get("parameters", {}).items():
            kind = entry.get("identifiability", "interval")
            label = words(f"{cause['effect']} {name}")
            if kind in ("at least", "at most"):
                end = entry["low" if kind == "at least" else "high"]
                sentences.append(f"{label} is {kind} {quantity(end, entry['unit'])}")
            elif kind != "interval":
                sentences.append(f"{label} is {kind} from this data")
    return sentences


def left_sentences(report: dict[str, Any]) -> list[str]:
    """Place and time of the structured error that no cause explains.

    If there are causes, also its share.
    """
    left = report.get("unexplained") or {}
    if not left.get("fraction"):
        return []
    share = (
        [f"{100 * left['fraction']:.0f}{NARROW}% of the structured error is left."]
        if report.get("causes")
        else []
    )
    return [
        *share,
        *(f"{key.capitalize()}: {left[key]}." for key in ("where", "when") if left.get(key)),
    ]


def _gain(report: dict[str, Any]) -> str:
    removed = (report.get("gain") or {}).get("reducible_removed") or {}
    if not isinstance(removed.get("value"), (int, float)):
        return ""
    naming = "naming it" if len(report.get("causes", [])) == 1 else "naming them"
    force = report["gain"].get("force") or {}
    if [cause["effect"] for cause in report["causes"]] == [
        "young_modulus"
    ] and force:  # no shape tells of it
        before, after = (quantity(force[name], "N") for name in ("baseline", "extended"))
        return (
            f"; {naming} brings the error of the force on the test sequences "
            f"from {before} to {after}"
        )
    if removed["value"] < 0.005:
        return f"; on the test sequences {naming} removes no error, so that they do not confirm it"
    return (
        f"; {naming} removes {100 * removed['value']:.0f}{NARROW}% of the error that can be removed"
    )


def _listed(phrases: list[str], word: str) -> str:
    return (
        phrases[0]
        if len(phrases) == 1
        else f"{', '.join(phrases[:-1])} {word} {phrases[-1]}"
        if phrases
        else "something"
    )


def _lump(values: Values, size: Sequence[float] | None) -> str:
    kind = "stiff" if values["stiffness_ratio"] >= 1.0 else "soft"
    place = "" if size is None else f", {quantity(size[2] - values['z'], 'm')} under the top"
    return f"a {kind} lump, {quantity(2 * values['radius'], 'm')} across{place}"


def _felt_lump(cause: dict[str, Any], values: Values) -> str:
    """A lump that was found from forces alone: its depth below the nearest skin."""
    kind = "stiff" if values["stiffness_ratio"] >= 1.0 else "soft"
    across, depth = quantity(2 * values["radius"], "m"), with_interval(cause["depth"])
    return f"a {kind} lump, {across} across, its centre {depth} under the surface"


def palpation_sentences(report: dict[str, Any]) -> list[str]:
    """The pushes, and for each lump its area on the surface and the tissue above it."""
    palpation = report.get("palpation")
    if not palpation:
        return []
    depth, force = (
        quantity(palpation[name]["value"], palpation[name]["unit"]) for name in ("depth", "force")
    )
    sentences = [f"{palpation['pushes']} pushes, about {depth} deep, against about {force}"]
    for cause in report.get("causes", []):
        if footprint := cause.get("footprint"):
            x, y, z = (quantity(value, "m") for value in footprint["middle"])
            area = f"{1e4 * footprint['area']:.1f}{NARROW}cm²"
            sentences.append(f"it is felt over {area} of the surface around ({x}, {y}, {z})")
        if cover := cause.get("cover"):
            sentences.append(f"{with_interval(cover)} of tissue lie above it")
    return sentences


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


def registration_sentences(report: dict[str, Any]) -> list[str]:
    """Origin of the camera's registration, if it is not the automatic one."""
    found = report.get("registration")
    if not found:
        return []
    how = f"by hand from {found['pairs']} pairs of points" if found["pairs"] else "automatically"
    left = (
        f", {1e3 * found['residual']:.2f} mm RMS left"
        if isinstance(found.get("residual"), (int, float))
        else ""
    )
    weak = f"; weak: {', '.join(found['weak_directions'])}" if found["weak_directions"] else ""
    return [f"Camera registered as {found['name']}, {how}{left}{weak}."]
