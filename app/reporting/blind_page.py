"""The blind suite as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from palpate.app.reporting.blind_plots import gain_plot, parameter_plot, reliability_plot
from palpate.app.reporting.blind_tables import (
    POSE,
    calibration_table,
    case_table,
    confusion_matrix,
    coverage_note,
    gain_table,
    kind_table,
    pair_table,
    parameter_table,
    target_table,
)
from palpate.app.reporting.html_page import render_page
from palpate.blind import CaseResult
from palpate.blind.parameter_errors import ReportedParameter, reported_parameters

__all__ = ["blind_page"]


def blind_page(summary: dict[str, Any], results: Sequence[CaseResult]) -> str:
    """The whole page: targets, kinds, reliability, gain, confusion, parameters, and every case."""
    groups: dict[str, list[ReportedParameter]] = {}
    for one in reported_parameters(results):
        if not POSE.match(one.key):
            groups.setdefault(one.key, []).append(one)
    removed = [
        one.removed
        for one in results
        if one.removed is not None and one.case.kind in ("clear", "subtle", "pair", "twins")
    ]
    return render_page(
        "blind.html",
        "blind",
        title=f"Blind suite, seed {summary['seed']}",
        count=_count(summary, results),
        problems=_problems(summary),
        targets=target_table(summary["targets"]),
        kinds=kind_table(summary["kinds"]),
        reliability_plot=reliability_plot(summary["calibration"]["first_effect"]["curve"]),
        calibration=calibration_table(summary["calibration"]),
        gain_plot=gain_plot(removed),
        gain=gain_table(summary["gain"]),
        confusion=confusion_matrix(summary["confusion"]),
        pairs=pair_table(summary["pairs"]),
        parameter_plot=parameter_plot(dict(sorted(groups.items()))),
        parameters=parameter_table(summary),
        coverage_note=coverage_note(summary),
        cases=case_table(results),
    )


def _count(summary: dict[str, Any], results: Sequence[CaseResult]) -> str:
    right, hours = sum(one.right for one in results), summary["seconds"]["sum"] / 3600
    cases = f"{right} of {len(results)} cases right"
    return f"{cases} · seed {summary['seed']} · {hours:.1f} hours of diagnosis"


def _problems(summary: dict[str, Any]) -> list[str]:
    problems = []
    if summary["missing"]:
        problems.append(f"{summary['missing']} cases have no result yet.")
    if len(summary["code"]) > 1:
        versions = ", ".join(
            f"{count} by {code or 'an unknown one'}" for code, count in summary["code"].items()
        )
        problems.append(f"Made by several versions of the code: {versions}.")
    if summary["errors"]:
        problems.append(f"{len(summary['errors'])} cases ended in an error and count as wrong.")
    return problems
