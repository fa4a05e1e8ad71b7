"""The blind suite as one HTML page that needs nothing but itself."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any

from palpate.app.reporting.blind_plots import gain_plot, parameter_plot, reliability_plot
from palpate.app.reporting.blind_tables import (
    POSE,
    calibration_table,
    case_table,
    confusion_table,
    gain_table,
    kind_table,
    pair_table,
    parameter_table,
    target_table,
)
from palpate.app.reporting.html_document import one_file, section
from palpate.blind import CaseResult
from palpate.blind.parameter_errors import ReportedParameter, reported_parameters

__all__ = ["blind_page"]


def blind_page(summary: dict[str, Any], results: Sequence[CaseResult]) -> str:
    """The whole page: targets, kinds, reliability, gain, what was named for what, parameters, and
    every case.
    """
    said = reported_parameters(results)
    groups: dict[str, list[ReportedParameter]] = {}
    for one in said:
        if not POSE.match(one.key):
            groups.setdefault(one.key, []).append(one)
    removed = [
        one.removed
        for one in results
        if one.removed is not None and one.case.kind in ("clear", "subtle", "pair", "twins")
    ]
    parts = [
        _head(summary, results),
        section("Targets", _TARGETS_NOTE, target_table(summary["targets"])),
        section(
            "Kinds of cases",
            "Shares with 95 % intervals (Clopper and Pearson).",
            kind_table(summary["kinds"]),
        ),
        '<div class="two half">',
        section(
            "Reliability",
            "Of each report's most probable effect, named or not: is it hidden? With numbers of cases.",
            reliability_plot(summary["calibration"]["first_effect"]["curve"])
            + calibration_table(summary["calibration"]),
        ),
        section(
            "Gain",
            "On sequences that nothing was fitted on, where something is hidden.",
            gain_plot(removed) + gain_table(summary["gain"]),
        ),
        "</div>",
        section(
            "What was named for what",
            "Rows: hidden. Columns: named alone, or the verdict. Pairs are apart.",
            confusion_table(summary["confusion"]) + pair_table(summary["pairs"]),
        ),
        section(
            "Parameters",
            _PARAMETERS_NOTE,
            parameter_plot(dict(sorted(groups.items()))) + parameter_table(summary),
        ),
        section("Every case", "", case_table(results)),
    ]
    return one_file(f"Blind suite, seed {summary['seed']}", "".join(parts), "blind")


_TARGETS_NOTE = "Parameter errors are medians over clear cases. A verdict in brackets could be chance: the 95 % interval crosses the bound."
_PARAMETERS_NOTE = "Of rightly named causes. Amber: the interval as reported leaves out the truth."


def _head(summary: dict[str, Any], results: Sequence[CaseResult]) -> str:
    right, hours = sum(one.right for one in results), summary["seconds"]["sum"] / 3600
    count = f"{right} of {len(results)} cases right · seed {summary['seed']} · {hours:.1f} hours of diagnosis"
    lines = [f"<h1>Blind suite</h1><p>{count}</p>"]
    if summary["missing"]:
        lines.append(f'<p class="bad">{summary["missing"]} cases have no result yet.</p>')
    if len(summary["code"]) > 1:
        listed = ", ".join(
            f"{count} by {code or 'an unknown one'}" for code, count in summary["code"].items()
        )
        lines.append(f'<p class="bad">Made by several versions of the code: {escape(listed)}.</p>')
    if summary["errors"]:
        lines.append(
            f'<p class="bad">{len(summary["errors"])} cases ended in an error and count as wrong.</p>'
        )
    return "".join(lines)
