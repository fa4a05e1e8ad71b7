"""The structured error that a diagnosis leaves: how much, where, when, and whether it matters."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.search.findings import Findings
from palpate.diagnosis.validation.checks import AllClearChecks
from palpate.diagnosis.validation.worst_location import worst_patch_location, worst_push_location

__all__ = ["small_remainder", "unexplained_error"]

_NOT_FITTED = ", on which nothing was fitted"


def unexplained_error(
    evaluator: Evaluator, findings: Findings, checks: AllClearChecks
) -> dict[str, Any]:
    """Structured error that is left: its share over chance, the place and the sequence."""
    model = findings.best.model if findings.best else findings.baseline
    before, left, note = findings.structure, findings.remaining, ""
    if checks.held_out_structure and checks.held_out is not None:
        model, before = checks.held_out.model, checks.held_out.structure
        left = before
        note = _NOT_FITTED
    when = _worst_sequence(model)
    size = _size(left.amplitude, left.motion)
    fraction = (
        max(left.ratio - 1.0, 0.0) / max(before.ratio, left.ratio, 1.0)
        if left.matters(checks.tolerance)
        else 0.0
    )
    if (one := checks.unusual) is not None and not left.matters(checks.tolerance):
        note = note if one is checks.stiffness_error else _NOT_FITTED
        when, fraction, place = one.sequence, one.share, one.place
        size = _size(one.amplitude, one.motion)
    else:
        place = (
            worst_patch_location(model.predictions, evaluator)
            if evaluator.problem.clouds
            else worst_push_location(model.predictions, evaluator)
        )
    where = str(place)
    when = f"most in {when}{note}"
    if findings.ripple.significant and not left.matters(checks.tolerance):
        fraction = findings.ripple.share
        where, when = (
            "all over rest.ply, alike at equal distances from the camera",
            "always, also while nothing is touched",
        )
    return {
        "fraction": round(fraction, 4),
        "where": where,
        "when": when,
        "misfit_per_value": round(evaluator.misfit(model), 4),
        "structure": round(left.ratio, 4),
        "structure_bound": round(left.bound / left.expected, 4),
        **size,
    }


def _size(amplitude: float, motion: float) -> dict[str, Any]:
    """Size of an error, and as a share of the visible surface's motion; None where unknown."""
    known = bool(np.isfinite(amplitude) and motion > 0)
    return {
        "rms_mm": round(1e3 * amplitude, 4) if known else None,
        "share_of_motion": round(amplitude / motion, 4) if known else None,
    }


def small_remainder(
    evaluator: Evaluator, findings: Findings, checks: AllClearChecks
) -> dict[str, Any] | None:
    """The largest error that is no noise and does not matter; None without any."""
    model, tolerance = findings.best.model if findings.best else findings.baseline, checks.tolerance
    left: list[tuple[float, float, str, Model]] = []
    if findings.remaining.significant and not findings.remaining.matters(tolerance):
        left.append((findings.remaining.amplitude, findings.remaining.motion, "", model))
    beyond = checks.held_out
    if beyond is not None and beyond.structure.significant and not checks.held_out_structure:
        structure = beyond.structure
        left.append((structure.amplitude, structure.motion, _NOT_FITTED, beyond.model))
    entries = [
        {
            **_size(amplitude, motion),
            "tolerance_mm": round(1e3 * tolerance.of(motion), 4),
            "where": str(worst_patch_location(own.predictions, evaluator)),
            "when": f"most in {_worst_sequence(own)}{note}",
        }
        for amplitude, motion, note, own in left
    ]
    if findings.misfit > CRITERIA.verdict.unexplained_misfit and not findings.poor:
        motion = findings.structure.motion
        entries.append(
            {
                **_size(findings.excess, motion),
                "tolerance_mm": round(1e3 * tolerance.of(motion), 4),
                "where": str(worst_patch_location(findings.baseline.predictions, evaluator)),
                "when": f"most in {_worst_sequence(findings.baseline)}",
            }
        )
    for one in checks.stiffness_errors:
        if one.significant and not one.matters(tolerance):
            entries.append(
                {
                    **_size(one.amplitude, one.motion),
                    "tolerance_mm": round(1e3 * tolerance.of(one.motion), 4),
                    "where": str(one.place),
                    "when": f"most in {one.sequence}",
                }
            )
    return max(entries, key=lambda entry: entry["rms_mm"], default=None)


def _worst_sequence(model: Model) -> str:
    """Name of the sequence with the largest misfit per value."""
    return max(
        (block for block in model.blocks if block.name != "rest"),
        key=lambda block: block.gram[0, 0] / max(block.values, 1),
    ).name
