"""Tables, bars and lists of a diagnosis report, as the template report.html shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from palpate.app.reporting.html_page import Bar, Cell, Table
from palpate.app.reporting.model_comparison import SequenceErrors
from palpate.app.reporting.report_plots import field_map
from palpate.app.reporting.sentences import limit_phrase
from palpate.foundation.quantities import NARROW, value_and_ends, words

__all__ = [
    "NamedCause",
    "Removed",
    "Step",
    "ladder_steps",
    "limit_table",
    "named_causes",
    "percent",
    "ranking_table",
    "removed_share",
    "sequence_table",
    "unidentifiable_texts",
]

_STEPS = (
    ("Raw model", "baseline", "raw"),
    ("Raw + network", "baseline_network", "corrected"),
    ("Extended", "extended", "extended"),
    ("Extended + network", "extended_network", "corrected"),
    ("Noise floor", "noise_floor", "floor"),
)
_SIMILAR = 0.3
"""Least share of an effect's pattern that another one has to imitate to be mentioned [1]."""


@dataclass(frozen=True)
class NamedCause:
    """A cause with its probability, and its parameters with their intervals.

    Attributes:
        effect: its name.
        probability: as text.
        parameters: with their intervals.
        map: of a field over the surface, as SVG; empty without one.
    """

    effect: str
    probability: str
    parameters: Table
    map: str = ""


@dataclass(frozen=True)
class Step:
    """A bar of the error ladder: error of one model.

    Attributes:
        label: name of the model.
        percent: length of the bar [%].
        value: the error with its unit.
        style: class that gives the colour.
    """

    label: str
    percent: float
    value: str
    style: str


@dataclass(frozen=True)
class Removed:
    """Share of the reducible error that is removed, and the text that follows it."""

    share: str
    text: str


def named_causes(causes: Sequence[dict[str, Any]]) -> list[NamedCause]:
    """The causes of a report, each with a table of its parameters."""
    named = []
    for cause in causes:
        rows = [
            (words(name), Cell(value_and_ends(entry)[0], style="b"), _interval(entry))
            for name, entry in cause.get("parameters", {}).items()
        ]
        rows += _in_file_frame(cause.get("in_file_frame", {}))
        table = Table(("", "value", "interval"), rows)
        chance = percent(cause.get("probability"))
        named.append(NamedCause(cause["effect"], chance, table, field_map(cause)))
    return named


def _in_file_frame(places: dict[str, Any]) -> list[tuple[str, Cell, str]]:
    """Rows of the places of a cause in the frame of the dataset's files."""
    line = places.get("polyline") or []
    named = [
        ("centre", places.get("centre")),
        *zip(("one end", "other end"), line[:: len(line) - 1 or 1], strict=False),
    ]
    return [
        (f"{name}, in the file's frame", Cell(_place(place), style="b"), "")
        for name, place in named
        if place
    ]


def _place(place: Sequence[float]) -> str:
    return f"({', '.join(f'{1e3 * value:.1f}' for value in place)}) mm"


def _interval(entry: dict[str, Any]) -> str:
    kind = entry.get("identifiability", "interval")
    _, low, high = value_and_ends(entry)
    if kind in ("at least", "at most"):
        return f"{kind} {low if kind == 'at least' else high}"
    if kind != "interval":
        return "not determined"
    return f"{low} to {high}" if low and high else ""


def ladder_steps(gain: dict[str, Any], named: bool) -> list[Step]:
    """The errors of the models as bars, down to the noise floor.

    Args:
        gain: of the report.
        named: whether a cause was named; otherwise the extended model is the raw one.
    """
    extended = _has_extended(gain, named)
    errors = [
        (label, float(gain[key]), style)
        for label, key, style in _STEPS
        if isinstance(gain.get(key), (int, float)) and (extended or key != "extended")
    ]
    largest = max((error for _, error, _ in errors), default=0.0) or 1.0
    unit = gain.get("unit", "mm")
    return [
        Step(label, 100 * error / largest, f"{error:.3f}{NARROW}{unit}", style)
        for label, error, style in errors
    ]


def removed_share(gain: dict[str, Any], named: bool) -> Removed | None:
    """Share of the reducible error that the named causes remove; None where it is unknown."""
    removed, tuned = gain.get("reducible_removed") or {}, gain.get("tuned") or {}
    if not _has_extended(gain, named):
        return Removed("", "No cause was named, so the model stays as it was.")
    if not isinstance(removed.get("value"), (int, float)):
        return None
    text = " of the error above the noise floor is gone."
    if isinstance(removed.get("low"), (int, float)):
        text = f" ({percent(removed['low'])} to {percent(removed['high'])}){text}"
    if isinstance(tuned.get("value"), (int, float)):
        text += (
            f" Of that, {percent(max(0.0, tuned['value']))} also go by fitting the robot's pose, "
            "the tool's radius and Poisson's ratio within their stated accuracies, "
            "with no cause named."
        )
    return Removed(percent(removed["value"]), text)


def _has_extended(gain: dict[str, Any], named: bool) -> bool:
    return named or isinstance(gain.get("baseline_network"), (int, float))


def sequence_table(rows: Sequence[SequenceErrors]) -> Table:
    """Errors of both models on each sequence; test sequences are bold."""
    cells: list[tuple[str | Cell, ...]] = []
    for row in rows:
        name = Cell(row.sequence, style="b" if row.split == "test" else "")
        errors = [_millimetres(error) for error in (row.raw, row.extended, row.noise_floor)]
        cells.append((name, row.split or "–", str(row.frames), *errors, percent(row.removed)))
    columns = ("sequence", "split", "frames", "raw", "extended", "floor", "removed")
    return Table(columns, cells, (2, 3, 4, 5, 6))


def ranking_table(report: dict[str, Any]) -> Table:
    """Error that each cause alone removes, and its probability; named causes are coloured."""
    named = {cause["effect"] for cause in report.get("causes", [])}
    rows: list[tuple[str | Bar, ...]] = []
    for entry in (report.get("ranking") or [])[:8]:
        removed = entry.get("error_removed")
        length = 100 * min(1.0, max(0.0, removed or 0.0))
        bar = Bar(length, "extended" if entry["effect"] in named else "")
        rows.append(
            (words(entry["effect"]), bar, percent(removed), percent(entry.get("probability")))
        )
    return Table(("effect", "error removed", "", "probability"), rows, (2, 3))


def limit_table(report: dict[str, Any]) -> Table:
    """Detection limit of each effect, and the effect that is most similar to it."""
    rows = []
    for row in report.get("ambiguity_map") or []:
        alike = next((one for one in row["alike"] if one["share"] >= _SIMILAR), None)
        like = f"{words(alike['effect'])} ({percent(alike['share'])})" if alike else "nothing else"
        rows.append((words(row["effect"]), limit_phrase(row), like))
    return Table(("effect", "would be named from", "looks most like"), rows)


def unidentifiable_texts(report: dict[str, Any]) -> list[str]:
    """Each effect that the data cannot show: why, and what to measure instead."""
    texts = []
    for row in report.get("not_identifiable") or []:
        text = f"{words(row['effect'])}: {row.get('why', '')}"
        if row.get("measure_instead"):
            text += f"; measure instead: {row['measure_instead']}"
        texts.append(text)
    return texts


def percent(value: Any) -> str:
    """A share [1] as a percentage; a dash where it is no number."""
    if not isinstance(value, (int, float)):
        return "–"
    return f"more than 99{NARROW}%" if 0.995 < value < 1.0 else f"{100 * value:.0f}{NARROW}%"


def _millimetres(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.3f}{NARROW}mm"
