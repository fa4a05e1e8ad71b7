"""A report in words: the sentences of the terminal, the page and the HTML report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from palpate.app.reporting.cause_phrases import cause_phrase
from palpate.foundation.quantities import NARROW, quantity, with_interval, words

__all__ = [
    "NEVER",
    "control_sentences",
    "determined_sentences",
    "left_sentences",
    "limit_phrase",
    "palpation_sentences",
    "probe_sentence",
    "registration_sentences",
    "verdict_sentence",
]

NEVER = "not at any size"
_NAMES = {"J_m": "chain limit J_m", "specific_weight_over_stiffness": "ρg/E"}
"""Parameters whose name says little."""


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
        return _nothing_named(report)
    if verdict == "unexplained":
        return "Structured error remains that no known effect removes."
    if verdict == "ambiguous" and (family := report.get("family")):
        left = ", ".join(
            f"{words(one['effect'])} leaves {100 * one['left']:.0f}{NARROW}% of the error"
            for one in family["members"]
        )
        sure = family["sure"][0].upper() + family["sure"][1:]
        return f"{sure}; by which law is open: {left}. What would tell: {family['parted_by']}."
    if verdict == "ambiguous":
        return f"Several causes explain the data equally well: {_listed(phrases, 'or')}."
    return f"The simulation misses {_listed(phrases, 'and')}{_gain(report)}."


def _nothing_named(report: dict[str, Any]) -> str:
    """The verdict `none`, with the hints of the ranking if there are any."""
    hints = [words(row["effect"]) for row in report.get("ranking", []) if row.get("hint")]
    small = report.get("small_remainder")
    if hints:
        why = "" if small is None else f": what it may explain is {_within(small)}"
        return (
            f"No cause is sure enough to be named; {_listed(hints, 'and')} "
            f"{'is a hint' if len(hints) == 1 else 'are hints'}{why}."
        )
    if small is not None:
        return f"The simulation misses nothing that matters: what is left is {_within(small)}."
    return (
        "The simulation misses nothing that this data could show: what is left is noise and "
        "the stated accuracies."
    )


def limit_phrase(row: dict[str, Any]) -> str:
    """Detection limit of an effect, from a row of the report's ambiguity map."""
    factors = [limit["factor"] for limit in row["limits"] if "factor" in limit]
    shares = [limit["share"] for limit in row["limits"] if "share" in limit]
    if None in (*factors, *shares, *(limit.get("change", 0.0) for limit in row["limits"])):
        return NEVER
    at = ", ".join(
        f"{_NAMES.get(name, words(name))} {quantity(one['value'], one['unit'])}"
        for name, one in row["at"].items()
    )
    if factors and "x" not in row["at"]:
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
        return f"{quantity(shares[0], '1')} times the change from the replay's mesh to a finer one"
    if shares:
        return f"{quantity(100 * shares[0], '1')}{NARROW}% of the change by {at}"
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
    left, small = report.get("unexplained") or {}, report.get("small_remainder")
    if not left.get("fraction") and not left.get("clues"):
        return [] if small is None else [_small(small), *_place(small)]
    share = (
        [f"{100 * left['fraction']:.0f}{NARROW}% of the structured error is left{_size(left)}."]
        if report.get("causes")
        else [f"It is{_size(left, ' ')}."] * bool(_size(left))
    )
    return [*share, *_place(left), *_clues(left.get("clues") or {})]


def _clues(clues: dict[str, Any]) -> list[str]:
    """Say when an error is left, what it moves with, what removes part of it, and what is next."""
    if not clues:
        return []
    shares = sorted(clues["moves_with"].items(), key=lambda one: -one[1])
    moves = ", ".join(f"{name} {100 * share:.0f}{NARROW}%" for name, share in shares)
    when = ", ".join(
        f"{phase} {quantity(1e-3 * size, 'm')}" for phase, size in clues["rms_mm_when"].items()
    )
    frames = ", ".join(
        f"{one['sequence']} at {one['time_s']:.2f}{NARROW}s" for one in clues["worst_frames"]
    )
    partial = ", ".join(
        f"{' and '.join(map(words, one['effects']))} leaves {100 * one['left']:.0f}{NARROW}%"
        for one in clues["partial_causes"]
        if one["effects"]
    )
    return [
        f"Size: {when}.",
        f"Moves with: {moves}.",
        *([f"Worst frames: {frames}."] if frames else []),
        *([f"Partial causes: {partial}."] if partial else []),
        f"Next: {clues['measure_next']}.",
    ]


def _small(left: dict[str, Any]) -> str:
    """Structured error within the tolerance."""
    return f"A structured error is left{_size(left)}, {_within(left)}."


def _within(left: dict[str, Any]) -> str:
    return f"within the tolerance of {quantity(1e-3 * left['tolerance_mm'], 'm')}"


def _size(left: dict[str, Any], before: str = ", ") -> str:
    """Size of what is left; empty where it is unknown."""
    if left.get("rms_mm") is None:
        return ""
    share = f"{100 * left['share_of_motion']:.2g}{NARROW}% of the surface's motion"
    return f"{before}{quantity(1e-3 * left['rms_mm'], 'm')} RMS or {share}"


def _place(left: dict[str, Any]) -> list[str]:
    return [f"{key.capitalize()}: {left[key]}." for key in ("where", "when") if left.get(key)]


def _gain(report: dict[str, Any]) -> str:
    removed = (report.get("gain") or {}).get("reducible_removed") or {}
    if not isinstance(removed.get("value"), (int, float)):
        return ""
    naming = "naming it" if len(report.get("causes", [])) == 1 else "naming them"
    force = report["gain"].get("force") or {}
    names = [cause["effect"] for cause in report["causes"]]
    # The shape does not depend on the modulus, only the force does.
    if names == ["young_modulus"] and force:
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


def registration_sentences(report: dict[str, Any]) -> list[str]:
    """Origin of the camera's registration, if it is not the automatic one."""
    registration = report.get("registration")
    if not registration:
        return []
    pairs = registration["pairs"]
    how = f"by hand from {pairs} pairs of points" if pairs else "automatically"
    left = (
        f", {1e3 * registration['residual']:.2f} mm RMS left"
        if isinstance(registration.get("residual"), (int, float))
        else ""
    )
    directions = registration["weak_directions"]
    weak = f"; weak: {', '.join(directions)}" if directions else ""
    return [f"Camera registered as {registration['name']}, {how}{left}{weak}."]
