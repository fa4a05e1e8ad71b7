"""Summary of a suite: targets, rates by kind, parameters, calibration, confusion, and gain."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from palpate.blind.calibration import (
    brier,
    calibration_error,
    every_effect,
    first_effect,
    reliability,
)
from palpate.blind.case_results import CaseResult
from palpate.blind.cases import KINDS
from palpate.blind.parameter_errors import (
    SCORED_LEVEL,
    coverage,
    parameter_errors,
    reported_parameters,
    words_right,
)
from palpate.blind.proportions import CONFIDENCE, median_of, share_of
from palpate.blind.targets import grade, judge_targets

__all__ = ["confusion", "summary_of"]

NOTHING, SEVERAL = "nothing", "several"


def summary_of(results: Sequence[CaseResult], seed: int, missing: int = 0) -> dict[str, Any]:
    """All scores as plain values.

    Args:
        results: of the suite.
        seed: from which the cases were drawn.
        missing: number of cases without a result.
    """
    return {
        "format": 1,
        "seed": seed,
        "cases": len(results),
        "missing": missing,
        "confidence": CONFIDENCE,
        "code": dict(Counter(result.code for result in results)),
        "targets": judge_targets(results),
        "kinds": {
            kind: _kind(own)
            for kind in KINDS
            if (own := [one for one in results if one.case.kind == kind])
        },
        "laws": {
            name: _kind(own)
            for name, second in (("catalogue", False), ("second", True))
            if (own := [one for one in results if one.truth and one.second_law is second])
        },
        "sizes": dict(
            Counter(grade(result) or "not given" for result in results if len(result.truth) == 1)
        ),
        "parameters": parameter_errors(reported_parameters(results)),
        "words": {key: found.to_json() for key, found in words_right(results).items()},
        "coverage": _coverage(results),
        "calibration": {
            "first_effect": _calibration(*first_effect(results)),
            "every_effect": _calibration(*every_effect(results)),
        },
        "confusion": confusion(results),
        "pairs": _pairs(results),
        "gain": _gain(results),
        "seconds": _seconds(results),
        "errors": {result.name: result.error for result in results if result.error},
    }


def _coverage(results: Sequence[CaseResult]) -> dict[str, Any]:
    reported = reported_parameters(results)
    return {
        "level_stated": sorted({result.level for result in results if result.report}),
        "at_stated_level": coverage(reported).to_json(),
        "level_scored": SCORED_LEVEL,
        "at_scored_level": coverage(reported, SCORED_LEVEL).to_json(),
    }


def _seconds(results: Sequence[CaseResult]) -> dict[str, Any]:
    spent = [result.seconds for result in results if result.seconds]
    return {"median": median_of(spent).to_json(), "sum": round(sum(spent), 1)}


def _kind(results: Sequence[CaseResult]) -> dict[str, Any]:
    """Rates of one kind of cases; with hidden effects also of naming them first and at all."""
    counted = {
        "right": share_of(results, lambda one: one.right),
        "false_name": share_of(results, lambda one: one.false_name),
        "error": share_of(results, lambda one: bool(one.error)),
    }
    if any(result.truth for result in results):
        counted |= {
            "first": share_of(results, lambda one: one.first),
            "inside": share_of(results, lambda one: one.inside),
            "exact": share_of(results, lambda one: one.exact),
        }
    verdicts = dict(Counter(result.verdict for result in results))
    return {
        "n": len(results),
        "verdicts": verdicts,
        **{name: found.to_json() for name, found in counted.items()},
    }


def _calibration(stated: Any, true: Any) -> dict[str, Any]:
    return {
        "n": len(stated),
        "brier": brier(stated, true).to_json(),
        "calibration_error": calibration_error(stated, true).to_json(),
        "curve": reliability(stated, true),
    }


def confusion(results: Sequence[CaseResult]) -> dict[str, dict[str, int]]:
    """Confusion matrix of all cases but pairs: hidden effects (rows) by named ones (columns).

    Columns beside the effects: `several` for a found set of more than one, and the verdicts that
    name no single cause.
    """
    table: dict[str, Counter[str]] = {}
    for result in results:
        if result.case.kind != "pair":
            row = result.case.hidden[0] if result.case.hidden else NOTHING
            table.setdefault(row, Counter())[_named(result)] += 1
    return {row: dict(counts) for row, counts in table.items()}


def _named(result: CaseResult) -> str:
    if result.verdict != "found":
        return result.verdict
    return result.named[0] if len(result.named) == 1 else SEVERAL


def _pairs(results: Sequence[CaseResult]) -> dict[str, int]:
    """Counts of pairs by the number of hidden effects that are named, and of others."""
    found: Counter[str] = Counter()
    for result in results:
        if result.case.kind == "pair":
            hits = len(result.truth & set(result.named))
            extra = ", and another" if set(result.named) - result.truth else ""
            found[f"{('neither', 'one', 'both')[hits]} named{extra}"] += 1
    return dict(found)


def _gain(results: Sequence[CaseResult]) -> dict[str, Any]:
    """Medians by kind of the share of reducible error removed, and of the error left over the noise
    floor.
    """
    table: dict[str, Any] = {}
    for kind in ("clear", "subtle", "pair", "twins"):
        own = [result for result in results if result.case.kind == kind]
        left = [
            gain["extended"] / gain["noise_floor"]
            for one in own
            if (gain := one.report.get("gain")) and gain["noise_floor"]
        ]
        if own:
            table[kind] = {
                "removed": median_of([one.removed or 0.0 for one in own]).to_json(),
                "left_over_noise_floor": median_of(left).to_json(),
            }
    return table
