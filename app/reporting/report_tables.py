"""The tables and lists of a report that is one file."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from palpate.app.reporting.html_document import table
from palpate.app.reporting.model_comparison import SequenceErrors
from palpate.app.reporting.quantities import NARROW, measured
from palpate.app.reporting.sentences import control_sentences, limit_phrase, probe_sentence

__all__ = [
    "cause_tables",
    "control_list",
    "ladder_bars",
    "limit_table",
    "probe_list",
    "ranking_table",
    "sequence_table",
    "untold_list",
]

_STEPS = (
    ("Raw model", "baseline", "raw"),
    ("Raw + network", "baseline_network", "corrected"),
    ("Extended", "extended", "extended"),
    ("Extended + network", "extended_network", "corrected"),
    ("Noise floor", "noise_floor", "floor"),
)
_ALIKE = 0.3


def cause_tables(causes: Sequence[dict[str, Any]]) -> str:
    """Each cause with its probability, and its parameters with their intervals."""
    parts = []
    for cause in causes:
        rows = [
            (_words(name), f"<b>{escape(measured(entry)[0])}</b>", escape(_interval(entry)))
            for name, entry in cause.get("parameters", {}).items()
        ]
        probable = _percent(cause.get("probability"))
        parts.append(
            f"<h3>{_words(cause['effect']).capitalize()} <span>probability {probable}</span></h3>"
        )
        parts.append(table(("", "value", "interval"), rows))
    return "".join(parts)


def _interval(entry: dict[str, Any]) -> str:
    told = entry.get("identifiability", "interval")
    _, low, high = measured(entry)
    if told in ("at least", "at most"):
        return f"{told} {low if told == 'at least' else high}"
    return (
        f"{low} to {high}"
        if told == "interval" and low and high
        else ""
        if told == "interval"
        else "not determined"
    )


def ladder_bars(gain: dict[str, Any], named: bool) -> str:
    """The errors of the models as bars, down to the noise floor, and what of it is removed."""
    added = named or isinstance(gain.get("baseline_network"), (int, float))
    steps = [
        (label, float(gain[key]), kind)
        for label, key, kind in _STEPS
        if isinstance(gain.get(key), (int, float)) and (added or key != "extended")
    ]
    if not steps:
        return ""
    most, unit = max(value for _, value, _ in steps) or 1.0, escape(str(gain.get("unit", "mm")))
    bars = "".join(
        f"<span>{label}</span><div class='bar'><i class='{kind}' style='width: {100 * value / most:.1f}%'></i></div>"
        f"<span>{value:.3f}{NARROW}{unit}</span>"
        for label, value, kind in steps
    )
    return f"<div class='ladder'>{bars}</div>{_removed(gain, added)}"


def _removed(gain: dict[str, Any], added: bool) -> str:
    removed, tuned = gain.get("reducible_removed") or {}, gain.get("tuned") or {}
    if not added:
        return "<p>No cause was named, so the model stays as it was.</p>"
    if not isinstance(removed.get("value"), (int, float)):
        return ""
    ends = (
        f" ({_percent(removed['low'])} to {_percent(removed['high'])})"
        if isinstance(removed.get("low"), (int, float))
        else ""
    )
    said = f"<b>{_percent(removed['value'])}</b>{ends} of the error above the noise floor is gone."
    if isinstance(tuned.get("value"), (int, float)):
        said += (
            f" Of that, {_percent(max(0.0, tuned['value']))} also go by fitting the robot's pose, the tool's radius and "
            "Poisson's ratio within their stated accuracies, with no cause named."
        )
    return f"<p>{said}</p>"


def sequence_table(rows: Sequence[SequenceErrors]) -> str:
    """Both models on each sequence; those that nothing was fitted on stand out."""
    cells = []
    for row in rows:
        name, split = escape(row.sequence), escape(row.split or "–")
        name = f"<b>{name}</b>" if row.split == "test" else name
        cells.append(
            (
                name,
                split,
                str(row.frames),
                *map(_millimetres, (row.raw, row.extended, row.noise_floor)),
                _percent(row.removed),
            )
        )
    return table(
        ("sequence", "split", "frames", "raw", "extended", "floor", "removed"),
        cells,
        (2, 3, 4, 5, 6),
    )


def ranking_table(report: dict[str, Any]) -> str:
    """What each cause alone removes; those that are named stand out."""
    named = {cause["effect"] for cause in report.get("causes", [])}
    rows = []
    for entry in (report.get("ranking") or [])[:8]:
        removed = entry.get("error_removed")
        width = 100 * min(1.0, max(0.0, removed or 0.0))
        kind = " class='extended'" if entry["effect"] in named else ""
        bar = f"<div class='bar'><i{kind} style='width: {width:.1f}%'></i></div>"
        rows.append(
            (_words(entry["effect"]), bar, _percent(removed), _percent(entry.get("probability")))
        )
    return table(("effect", "error removed", "", "probability"), rows, (2, 3)) if rows else ""


def limit_table(report: dict[str, Any]) -> str:
    """Each effect's detection limit, and what looks most like it."""
    rows = []
    for row in report.get("ambiguity_map") or []:
        alike = next((one for one in row["alike"] if one["share"] >= _ALIKE), None)
        like = (
            f"{_words(alike['effect'])} ({_percent(alike['share'])})" if alike else "nothing else"
        )
        rows.append((_words(row["effect"]), escape(limit_phrase(row)), like))
    return table(("effect", "would be named from", "looks most like"), rows) if rows else ""


def control_list(report: dict[str, Any]) -> str:
    """One sentence for each thing that the controls say."""
    return _list(control_sentences(report.get("controls") or []))


def probe_list(report: dict[str, Any]) -> str:
    """What to measure next, what would tell most first."""
    return _list([probe_sentence(row) for row in report.get("next_probe") or []])


def untold_list(report: dict[str, Any]) -> str:
    """What cannot be told, why, and what would tell it."""
    rows = report.get("not_identifiable") or []
    return _list(
        [
            f"{one['effect'].replace('_', ' ')}: {one.get('why', '')}"
            + (f"; measure instead: {one['measure_instead']}" if one.get("measure_instead") else "")
            for one in rows
        ]
    )


def _list(lines: Sequence[str]) -> str:
    return (
        f"<ul>{''.join(f'<li>{escape(_capital(line))}</li>' for line in lines)}</ul>"
        if lines
        else ""
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def _words(name: str) -> str:
    return escape(name.replace("_", " "))


def _percent(value: Any) -> str:
    if not isinstance(value, (int, float)):
        return "–"
    return f"more than 99{NARROW}%" if 0.995 < value < 1.0 else f"{100 * value:.0f}{NARROW}%"


def _millimetres(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.3f}{NARROW}mm"
