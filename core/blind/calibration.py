"""Calibration of a report's probabilities: reliability curve, Brier score, calibration error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.blind.case_results import CaseResult
from palpate.blind.proportions import CONFIDENCE, IntervalEstimate, rate
from palpate.foundation.arrays import FloatArray

__all__ = ["brier", "calibration_error", "every_effect", "first_effect", "reliability"]

BINS = 10
"""Number of bins of the stated probability."""
_DRAWS = 1000
"""Number of bootstrap samples."""


def first_effect(results: Sequence[CaseResult]) -> tuple[FloatArray, FloatArray]:
    """Probability (n,) [1] of the most probable effect of each report, named or not, and whether it
    is hidden (n,) (0 or 1).

    Effects that are improbable and absent do not count, so they cannot improve the score.
    """
    best = [
        (max(chances.items(), key=lambda row: row[1]), result.truth)
        for result in results
        if (chances := result.probabilities)
    ]
    return np.array([chance for (_, chance), _ in best]), np.array(
        [float(effect in truth) for (effect, _), truth in best]
    )


def every_effect(results: Sequence[CaseResult]) -> tuple[FloatArray, FloatArray]:
    """Probability (n,) [1] of every effect in every case, and whether it is hidden (n,) (0 or 1);
    most are correct zeros.
    """
    pairs = [
        (chance, effect in result.truth)
        for result in results
        for effect, chance in result.probabilities.items()
    ]
    return np.array([chance for chance, _ in pairs]), np.array(
        [float(hidden) for _, hidden in pairs]
    )


def reliability(stated: FloatArray, true: FloatArray) -> list[dict[str, Any]]:
    """Reliability curve: for each tenth of the stated probability its mean, and the share that is
    true with an interval; empty tenths are left out.
    """
    which, rows = _bins(stated), []
    for number in np.unique(which):
        here = which == number
        share = rate(int(true[here].sum()), int(here.sum()))
        rows.append(
            {
                "low": number / BINS,
                "high": (number + 1) / BINS,
                "stated": float(stated[here].mean()),
                "true": share.to_json(),
            }
        )
    return rows


def brier(stated: FloatArray, true: FloatArray) -> IntervalEstimate:
    """Brier score: mean squared difference of stated probability and truth (Brier 1950), with a
    bootstrap interval.
    """
    return _resampled(stated, true, lambda p, y: float(((p - y) ** 2).mean()))


def calibration_error(stated: FloatArray, true: FloatArray) -> IntervalEstimate:
    """Expected calibration error: |mean stated - share true| over tenths, weighted by their counts,
    with a bootstrap interval.
    """
    return _resampled(stated, true, _expected_error)


def _expected_error(stated: FloatArray, true: FloatArray) -> float:
    counts = np.bincount(_bins(stated), minlength=BINS)
    off = np.bincount(_bins(stated), weights=stated - true, minlength=BINS)
    return float(np.abs(off).sum() / counts.sum())


def _bins(stated: FloatArray) -> Any:
    return np.minimum((stated * BINS + 1e-9).astype(int), BINS - 1)


def _resampled(stated: FloatArray, true: FloatArray, figure: Any) -> IntervalEstimate:
    if not len(stated):
        return IntervalEstimate(None, None, None, 0)
    drawn = np.random.default_rng(0).integers(0, len(stated), size=(_DRAWS, len(stated)))
    values = [figure(stated[one], true[one]) for one in drawn]
    low, high = np.quantile(values, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return IntervalEstimate(figure(stated, true), float(low), float(high), len(stated))
