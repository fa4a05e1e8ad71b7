"""Tables of the blind suite, as the template blind.html shows them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from palpate.app.reporting.html_page import Cell, Table
from palpate.blind import CaseResult
from palpate.foundation.quantities import NARROW, parameters_text, quantity, words

__all__ = [
    "POSE",
    "TITLES",
    "ConfusionMatrix",
    "calibration_table",
    "case_table",
    "confusion_matrix",
    "coverage_note",
    "figure_text",
    "gain_table",
    "hidden_text",
    "kind_table",
    "named_text",
    "pair_table",
    "parameter_table",
    "target_table",
    "target_text",
]

TITLES = {
    "control": "nothing hidden",
    "clear": "one effect, clear",
    "subtle": "one effect, subtle",
    "pair": "two effects",
    "outside": "outside the catalogue",
    "twins": "look-alikes",
    "modulus": "modulus alone",
    "fault": "fault of the bench",
}
VERDICTS = ("several", "ambiguous", "none", "unexplained", "error")
POSE = re.compile(r"camera_registration\.[tr][xyz]$")
"""Parameters that are shown as two magnitudes."""


def hidden_text(result: CaseResult) -> str:
    """The hidden effects with their parameters."""
    effects = _listed(result.hidden)
    return (
        effects
        or ", ".join(one["effect"] for one in result.outside)
        or ", ".join(result.case.hidden)
        or "nothing"
    )


def named_text(result: CaseResult) -> str:
    """The named effects with their parameters, or the error that ended the case."""
    return result.error or _listed(result.causes) or "–"


def _listed(causes: Iterable[dict[str, Any]]) -> str:
    """Effects with their parameters; a camera pose by its magnitudes only."""
    texts = []
    for cause in causes:
        entries = {
            name: one
            for name, one in cause["parameters"].items()
            if not POSE.match(f"{cause['effect']}.{name}")
        }
        texts.append(f"{cause['effect']}: {parameters_text({'parameters': entries})}")
    return "; ".join(texts)


def target_text(target: dict[str, Any]) -> str:
    """`at least 95 %`, `at most 2.5 mm`, or `85 to 95 %`."""
    low, high, unit = target["at_least"], target["at_most"], target["unit"]
    if low is not None and high is not None:
        return f"{100 * low:g} to {100 * high:g}{NARROW}%"
    return f"at least {_number(low, unit)}" if high is None else f"at most {_number(high, unit)}"


def figure_text(measured: dict[str, Any], unit: str = "1") -> tuple[str, str]:
    """A value with its number of cases, and its interval; dashes where there is none."""
    if measured["value"] is None:
        return "–", ""
    counted = (
        f" ({measured['hits']} of {measured['n']})"
        if "hits" in measured
        else f" ({measured['n']} cases)"
    )
    ends = [measured["low"], measured["high"]]
    interval = (
        f"{_number(ends[0], unit)} to {_number(ends[1], unit)}"
        if None not in ends
        else "too few cases"
    )
    return _number(measured["value"], unit) + counted, interval


def _number(value: float, unit: str) -> str:
    if unit == "1":
        return f"{round(100 * value, 1):g}{NARROW}%"
    return quantity(value, "1" if unit == "nu" else unit)


@dataclass(frozen=True)
class Count:
    """An entry of the confusion matrix.

    Attributes:
        count: number of cases.
        share: of the row's cases [1].
        right: whether the name or verdict is the right one.
    """

    count: int
    share: float
    right: bool


@dataclass(frozen=True)
class ConfusionRow:
    """Counts of the cases in which one effect, or nothing, was hidden."""

    hidden: str
    counts: Sequence[Count]


@dataclass(frozen=True)
class ConfusionMatrix:
    """Names and verdicts (columns) by what was hidden (rows)."""

    columns: Sequence[str]
    rows: Sequence[ConfusionRow]


def target_table(targets: Sequence[dict[str, Any]]) -> Table:
    """Each target with what is reached; a verdict that could be chance is in brackets."""
    rows: list[tuple[str | Cell, ...]] = []
    for one in targets:
        figure, interval = figure_text(one["reached"], one["unit"])
        mark = "no cases" if one["met"] is None else "✓ met" if one["met"] else "✗ missed"
        style = {True: "met", False: "missed", None: "dim"}[one["met"]]
        mark = mark if one["met"] is None or one["sure"] else f"({mark})"
        rows.append((one["text"], target_text(one), figure, interval, Cell(mark, style=style)))
    return Table(("", "target", "reached", "95 % interval", ""), rows)


def kind_table(kinds: dict[str, dict[str, Any]]) -> Table:
    """Cases of each kind: right, first, among, false names, and the verdicts."""
    rows: list[tuple[str | Cell, ...]] = []
    for kind, counted in kinds.items():
        cells = [
            _hits(counted.get(name))
            for name in ("right", "first", "inside", "exact", "false_name", "error")
        ]
        verdicts = ", ".join(
            f"{count} {verdict}"
            for verdict, count in sorted(counted["verdicts"].items(), key=lambda row: -row[1])
        )
        rows.append((TITLES[kind], str(counted["n"]), *cells, verdicts))
    columns = (
        "",
        "cases",
        "right",
        "truth first",
        "truth among named",
        "exactly it",
        "a false name",
        "error",
        "verdicts",
    )
    return Table(columns, rows, (1,))


def _hits(measured: dict[str, Any] | None, counted: bool = False) -> Cell:
    if measured is None or not measured["n"]:
        return Cell("–", style="dim")
    low, high = 100 * measured["low"], 100 * measured["high"]
    total = f" of {measured['n']}" if counted else ""
    return Cell(f"{measured['hits']}{total}", f"({low:.0f}–{high:.0f}{NARROW}%)")


def calibration_table(calibration: dict[str, Any]) -> Table:
    """Brier score and calibration error, of the most probable effect and of all."""
    rows: list[tuple[str | Cell, ...]] = []
    for key, text in (
        ("first_effect", "most probable effect"),
        ("every_effect", "every effect in every case"),
    ):
        own = calibration[key]
        scores = (_score(own[name]) for name in ("brier", "calibration_error"))
        rows.append((text, str(own["n"]), *scores))
    return Table(("", "n", "Brier score", "calibration error"), rows, (1,))


def _score(measured: dict[str, Any]) -> Cell:
    if measured["value"] is None:
        return Cell("–")
    return Cell(f"{measured['value']:.3f}", f"({measured['low']:.3f} to {measured['high']:.3f})")


def gain_table(gain: dict[str, Any]) -> Table:
    """Medians by kind of the share removed, and of the rest over the noise floor."""
    rows: list[tuple[str | Cell, ...]] = []
    for kind, own in gain.items():
        share, interval = figure_text(own["removed"])
        left = own["left_over_noise_floor"]["value"]
        rows.append((TITLES[kind], share, interval, "–" if left is None else f"{left:.2f}"))
    return Table(("median", "removed", "95 % interval", "left / floor"), rows, (3,))


def confusion_matrix(confusion: dict[str, dict[str, int]]) -> ConfusionMatrix:
    """Counts of names and verdicts by what was hidden, in the order of the catalogue."""
    from palpate.synthetic import DISTURBANCES, HIDDEN

    right = {
        "nothing": ("none",),
        "young_modulus": ("none",),
        **dict.fromkeys(DISTURBANCES, ("ambiguous", "unexplained")),
    }
    order = [*HIDDEN, *DISTURBANCES, "nothing"]
    hidden = sorted(confusion, key=lambda row: order.index(row) if row in order else len(HIDDEN))
    seen = {column for counts in confusion.values() for column in counts}
    named = [row for row in hidden if row in seen]
    others = sorted(seen - set(named) - set(VERDICTS))
    columns = [*named, *others, *(verdict for verdict in VERDICTS if verdict in seen)]
    rows = [
        ConfusionRow(row, _counts(confusion[row], columns, {row, *right.get(row, ())}))
        for row in hidden
    ]
    return ConfusionMatrix(columns, rows)


def _counts(counts: dict[str, int], columns: Sequence[str], right: Collection[str]) -> list[Count]:
    total = sum(counts.values())
    return [
        Count(counts.get(column, 0), counts.get(column, 0) / total, column in right)
        for column in columns
    ]


def pair_table(pairs: dict[str, int]) -> Table:
    """Number of named effects in cases with two hidden ones."""
    rows = [(text, str(count)) for text, count in sorted(pairs.items(), key=lambda row: -row[1])]
    return Table(("two effects hidden", "cases"), rows, (1,))


def parameter_table(summary: dict[str, Any]) -> Table:
    """Median error of each parameter, the largest, the bias, and the coverage of the intervals."""
    rows: list[tuple[str | Cell, ...]] = []
    for key, own in sorted(summary["parameters"].items()):
        unit = "nu" if own["unit"] in ("1", "") else own["unit"]
        median, interval = figure_text(own["median"], unit)
        errors = (_number(own["largest"], unit), _number(own["mean_signed"], unit))
        covered = _hits(own["covered"], counted=True)
        rows.append((words(key.replace(".", ": ")), median, interval, *errors, covered))
    for key, own in sorted(summary["words"].items()):
        right = f"right in {own['hits']} of {own['n']}"
        rows.append((words(key.replace(".", ": ")), right, "", "", "", ""))
    columns = (
        "",
        "median error",
        "95 % interval",
        "largest",
        "mean, signed",
        f"{_scored_level(summary)} intervals that hold",
    )
    return Table(columns, rows)


def coverage_note(summary: dict[str, Any]) -> str:
    """Note on the scoring of the reports' intervals; empty where no report states a level."""
    levels = [f"{100 * one:.0f}{NARROW}%" for one in summary["coverage"]["level_stated"]]
    if not levels:
        return ""
    return (
        f"The reports state {' and '.join(levels)} intervals; they are scored narrowed to "
        f"{_scored_level(summary)}, as a normal distribution's would be."
    )


def _scored_level(summary: dict[str, Any]) -> str:
    return f"{100 * summary['coverage']['level_scored']:.0f}{NARROW}%"


def case_table(results: Sequence[CaseResult]) -> Table:
    """Hidden effects and diagnosis of each case; wrong ones are highlighted."""
    rows: list[tuple[str | Cell, ...]] = []
    for one in results:
        removed = "–" if one.removed is None else f"{100 * one.removed:.0f}{NARROW}%"
        size = "–" if one.size is None else f"{one.size:.1f}"
        mark = Cell("✓", style="met") if one.right else Cell("✗", style="missed")
        texts = (one.name, hidden_text(one), one.verdict, named_text(one))
        gain = Cell(f"{one.gain:.0f}", f"({one.bound:.0f})")
        rows.append((*texts, gain, removed, size, f"{one.seconds:.0f}{NARROW}s", mark))
    columns = (
        "case",
        "hidden",
        "verdict",
        "named",
        "gain (bound), nats",
        "removed",
        "size / limit",
        "time",
        "",
    )
    wrong = [number for number, one in enumerate(results) if not one.right]
    return Table(columns, rows, (4, 5, 6, 7), wrong)
