"""Tables, bars and lists of a diagnosis report, as the template report.html shows them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from palpate.app.reporting.html_page import Bar, Cell, Table
from palpate.app.reporting.model_comparison import SequenceErrors
from palpate.app.reporting.report_plots import field_map
from palpate.app.reporting.sentences import NEVER, limit_phrase
from palpate.foundation.quantities import NARROW, value_and_ends, words

__all__ = [
    "LimitRow",
    "NamedCause",
    "RankingRow",
    "Removed",
    "Step",
    "chance",
    "ladder_steps",
    "limit_rows",
    "limit_table",
    "named_causes",
    "percent",
    "ranking_note",
    "ranking_rows",
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
_RANKED = 8
"""Causes in the ranking beside the named ones."""
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


@dataclass(frozen=True, kw_only=True)
class RankingRow:
    """A cause in the ranking.

    Attributes:
        effect: its name.
        share: of the error that it alone removes [1], for its bar.
        removed: the same as text.
        probability: as text.
        named: whether the verdict names it.
    """

    effect: str
    share: float
    removed: str
    probability: str
    named: bool


@dataclass(frozen=True, kw_only=True)
class LimitRow:
    """The smallest size of an effect that would be named, and what it looks like, as texts."""

    effect: str
    size: str
    like: str


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
        likely = chance(cause.get("probability"))
        named.append(NamedCause(cause["effect"], likely, table, field_map(cause)))
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


def ranking_rows(report: dict[str, Any]) -> list[RankingRow]:
    """The named causes first, then the most likely others.

    Where structured error is left that no effect removes, no probability is stated: it would be
    that of a cause which is not the whole cause.
    """
    causes, entries = report.get("causes", []), report.get("ranking") or []
    listed = {entry["effect"]: entry for entry in entries}
    gain = report.get("gain") or {}
    together = (gain.get("reducible_removed") or {}).get("value") if len(causes) == 1 else None
    rows = [
        _ranked({"error_removed": together, **cause, **listed.get(cause["effect"], {})}, True, True)
        for cause in causes
    ]
    named, sure = {cause["effect"] for cause in causes}, report.get("verdict") != "unexplained"
    others = [entry for entry in entries if entry["effect"] not in named]
    return rows + [_ranked(entry, False, sure) for entry in others[:_RANKED]]


def _ranked(entry: dict[str, Any], named: bool, sure: bool) -> RankingRow:
    removed = entry.get("error_removed")
    return RankingRow(
        effect=entry["effect"],
        share=min(1.0, max(0.0, removed or 0.0)),
        removed=percent(removed),
        probability=chance(entry.get("probability")) if sure else "–",
        named=named,
    )


def ranking_table(report: dict[str, Any]) -> Table:
    """Error that each cause alone removes, and its probability; named causes are coloured."""
    rows: list[tuple[str | Bar, ...]] = [
        (
            words(row.effect),
            Bar(100 * row.share, "extended" if row.named else ""),
            row.removed,
            row.probability,
        )
        for row in ranking_rows(report)
    ]
    return Table(("effect", "error removed", "", "probability"), rows, (2, 3))


def ranking_note(report: dict[str, Any]) -> str:
    """Say what the ranking shows."""
    removed = "How much of the error each cause alone removes"
    if report.get("verdict") == "unexplained":
        return f"{removed}. None of them is the whole cause, so that no probability is stated."
    return f"{removed}, and how probable it is."


def limit_rows(report: dict[str, Any]) -> list[LimitRow]:
    """Detection limit of each effect, and the effect that is most similar to it."""
    named = {cause["effect"] for cause in report.get("causes", [])}
    rows = []
    for row in report.get("ambiguity_map") or []:
        alike = next((one for one in row["alike"] if one["share"] >= _SIMILAR), None)
        like = f"{words(alike['effect'])} ({percent(alike['share'])})" if alike else "nothing else"
        size = limit_phrase(row)
        if size == NEVER and row["effect"] in named:
            size = "the size that was found"
        rows.append(LimitRow(effect=row["effect"], size=size, like=like))
    return rows


def limit_table(report: dict[str, Any]) -> Table:
    """`limit_rows` as a table."""
    rows = [(words(row.effect), row.size, row.like) for row in limit_rows(report)]
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


def chance(value: Any) -> str:
    """A probability [1] as a percentage; it is never certain."""
    if not isinstance(value, (int, float)):
        return "–"
    if value > 0.999:
        return f"> 99.9{NARROW}%"
    if value < 0.001:
        return f"< 0.1{NARROW}%"
    return f"{100 * value:.1f}{NARROW}%" if value > 0.99 else f"{100 * value:.0f}{NARROW}%"


def percent(value: Any) -> str:
    """A share [1] as a percentage; a dash where it is no number."""
    if not isinstance(value, (int, float)):
        return "–"
    return f"more than 99{NARROW}%" if 0.995 < value < 1.0 else f"{100 * value:.0f}{NARROW}%"


def _millimetres(value: float | None) -> str:
    return "–" if value is None else f"{1e3 * value:.3f}{NARROW}mm"
