"""The tables of the blind suite's page."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from html import escape
from typing import Any

from palpate.app.reporting.html_document import table
from palpate.app.reporting.quantities import NARROW, parameters_text, quantity
from palpate.blind import CaseResult

__all__ = [
    "POSE",
    "TITLES",
    "calibration_table",
    "case_table",
    "confusion_table",
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
}
VERDICTS = ("several", "ambiguous", "none", "unexplained", "error")
POSE = re.compile(r"camera_registration\.[tr][xyz]$")
"""Parameters that a person reads as two magnitudes."""


def hidden_text(result: CaseResult) -> str:
    """What is hidden, with its parameters."""
    effects = _listed(result.hidden)
    return (
        effects
        or ", ".join(one["effect"] for one in result.outside)
        or ", ".join(result.case.hidden)
        or "nothing"
    )


def named_text(result: CaseResult) -> str:
    """What is named, with its parameters; of a case that ended in an error that."""
    return result.error or _listed(result.causes) or "–"


def _listed(causes: Iterable[dict[str, Any]]) -> str:
    """A camera's pose by its magnitudes alone."""
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
    """A figure and its interval, each an empty dash where there is none."""
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


def target_table(targets: Sequence[dict[str, Any]]) -> str:
    """Each target with what is reached; a verdict that chance could turn is in brackets."""
    rows = []
    for one in targets:
        figure, interval = figure_text(one["reached"], one["unit"])
        mark = "no cases" if one["met"] is None else "✓ met" if one["met"] else "✗ missed"
        kind = {True: "met", False: "missed", None: "dim"}[one["met"]]
        mark = mark if one["met"] is None or one["sure"] else f"({mark})"
        rows.append(
            (
                escape(one["text"]),
                target_text(one),
                figure,
                interval,
                f"<span class='{kind}'>{mark}</span>",
            )
        )
    return table(("", "target", "reached", "95 % interval", ""), rows)


def kind_table(kinds: dict[str, dict[str, Any]]) -> str:
    """Cases of each kind: right, first, among, false names, and the verdicts."""
    rows = []
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
    return table(columns, rows, (1,))


def _hits(measured: dict[str, Any] | None, counted: bool = False) -> str:
    if measured is None:
        return "<span class='dim'>–</span>"
    if not measured["n"]:
        return "<span class='dim'>–</span>"
    low, high = 100 * measured["low"], 100 * measured["high"]
    of = f" of {measured['n']}" if counted else ""
    return f"{measured['hits']}{of} <span class='dim'>({low:.0f}–{high:.0f}{NARROW}%)</span>"


def calibration_table(calibration: dict[str, Any]) -> str:
    """Brier score and calibration error, of the most probable effect and of all."""
    rows = []
    for key, text in (
        ("first_effect", "most probable effect"),
        ("every_effect", "every effect in every case"),
    ):
        own = calibration[key]
        rows.append(
            (text, str(own["n"]), *(_plain(own[name]) for name in ("brier", "calibration_error")))
        )
    return table(("", "n", "Brier score", "calibration error"), rows, (1,))


def _plain(measured: dict[str, Any]) -> str:
    if measured["value"] is None:
        return "–"
    return f"{measured['value']:.3f} <span class='dim'>({measured['low']:.3f} to {measured['high']:.3f})</span>"


def gain_table(gain: dict[str, Any]) -> str:
    """Medians by kind of the share removed, and of what is left over the noise floor."""
    rows = []
    for kind, own in gain.items():
        share, interval = figure_text(own["removed"])
        left = own["left_over_noise_floor"]["value"]
        rows.append((TITLES[kind], share, interval, "–" if left is None else f"{left:.2f}"))
    return table(("median", "removed", "95 % interval", "left / floor"), rows, (3,))


def confusion_table(confusion: dict[str, dict[str, int]]) -> str:
    """A matrix with shades: teal where the name or verdict is what is hidden, amber where it is
    not.
    """
    from palpate.synthetic import DISTURBANCES, HIDDEN

    good = {
        "nothing": ("none",),
        "young_modulus": ("none",),
        **dict.fromkeys(DISTURBANCES, ("ambiguous", "unexplained")),
    }
    order = [*HIDDEN, *DISTURBANCES, "nothing"]
    hidden = sorted(confusion, key=lambda row: order.index(row) if row in order else len(HIDDEN))
    named = [row for row in hidden if any(row in counts for counts in confusion.values())]
    others = sorted(
        {column for counts in confusion.values() for column in counts} - set(named) - set(VERDICTS)
    )
    columns = [
        *named,
        *others,
        *(
            verdict
            for verdict in VERDICTS
            if any(verdict in counts for counts in confusion.values())
        ),
    ]
    head = "".join(f"<th>{_words(column)}</th>" for column in columns)
    body = "".join(
        f"<tr><th>{_words(row)}</th>{_cells(confusion[row], columns, {row, *good.get(row, ())})}</tr>"
        for row in hidden
    )
    return f"<table class='matrix'><thead><tr><th></th>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cells(counts: dict[str, int], columns: Sequence[str], good: Collection[str]) -> str:
    total, cells = sum(counts.values()), []
    for column in columns:
        count = counts.get(column, 0)
        kind = "yes" if column in good else "no"
        cells.append(
            f"<td class='{kind}' style='--share:{count / total:.3f}'>{count}</td>"
            if count
            else "<td></td>"
        )
    return "".join(cells)


def _words(name: str) -> str:
    return escape(name.replace("_", " "))


def pair_table(pairs: dict[str, int]) -> str:
    """Of two hidden effects how many are named."""
    if not pairs:
        return ""
    rows = [(text, str(count)) for text, count in sorted(pairs.items(), key=lambda row: -row[1])]
    return f"<div class='narrow'>{table(('two effects hidden', 'cases'), rows, (1,))}</div>"


def parameter_table(summary: dict[str, Any]) -> str:
    """Median error of each parameter, the largest, the bias, and how many intervals hold the
    truth."""
    rows = []
    for key, own in sorted(summary["parameters"].items()):
        unit = "nu" if own["unit"] in ("1", "") else own["unit"]
        median, interval = figure_text(own["median"], unit)
        cells = (
            _number(own["largest"], unit),
            _number(own["mean_signed"], unit),
            _hits(own["covered"], counted=True),
        )
        rows.append((_words(key.replace(".", ": ")), median, interval, *cells))
    for key, own in sorted(summary["words"].items()):
        rows.append(
            (
                _words(key.replace(".", ": ")),
                f"right in {own['hits']} of {own['n']}",
                "",
                "",
                "",
                "",
            )
        )
    level = f"{100 * summary['coverage']['level_scored']:.0f}{NARROW}%"
    stated = " and ".join(
        f"{100 * one:.0f}{NARROW}%" for one in summary["coverage"]["level_stated"]
    )
    note = f"<p>The reports state {stated} intervals; they are scored narrowed to {level}, as a normal distribution's would be.</p>"
    shown = table(
        (
            "",
            "median error",
            "95 % interval",
            "largest",
            "mean, signed",
            f"{level} intervals that hold",
        ),
        rows,
    )
    return note + shown if stated else shown


def case_table(results: Sequence[CaseResult]) -> str:
    """What was hidden and said in each case; wrong ones stand out."""
    rows = []
    for one in results:
        removed = "–" if one.removed is None else f"{100 * one.removed:.0f}{NARROW}%"
        size = "–" if one.size is None else f"{one.size:.1f}"
        mark = "<span class='met'>✓</span>" if one.right else "<span class='missed'>✗</span>"
        texts = (
            escape(text) for text in (one.name, hidden_text(one), one.verdict, named_text(one))
        )
        gain = f"{one.gain:.0f} <span class='dim'>({one.bound:.0f})</span>"
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
    return table(columns, rows, (4, 5, 6, 7), [not one.right for one in results])
