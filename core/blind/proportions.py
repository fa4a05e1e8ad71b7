"""Shares and medians with confidence intervals."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from scipy.stats import binomtest, quantile_test

__all__ = ["CONFIDENCE", "IntervalEstimate", "median_of", "rate", "share_of"]

T = TypeVar("T")
CONFIDENCE = 0.95
"""Level of the intervals of a summary [1]; those of parameters have the level of the report."""


@dataclass(frozen=True)
class IntervalEstimate:
    """An estimate with its interval.

    Attributes:
        value: None without cases.
        low: end of the interval; None with too few cases.
        high: end of the interval; None with too few cases.
        n: number of cases.
        hits: number of successes of a share; None for other figures.
    """

    value: float | None
    low: float | None
    high: float | None
    n: int
    hits: int | None = None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        counted = {"hits": self.hits} if self.hits is not None else {}
        return {
            "value": _plain(self.value),
            "low": _plain(self.low),
            "high": _plain(self.high),
            **counted,
            "n": self.n,
        }


def rate(hits: int, n: int) -> IntervalEstimate:
    """A share [1] with the interval of Clopper and Pearson (1934)."""
    if n == 0:
        return IntervalEstimate(None, None, None, 0, 0)
    ends = binomtest(hits, n).proportion_ci(CONFIDENCE, method="exact")
    return IntervalEstimate(hits / n, float(ends.low), float(ends.high), n, hits)


def share_of(results: Iterable[T], holds: Callable[[T], bool]) -> IntervalEstimate:
    """Share of the results for which `holds` is true."""
    answers = [holds(result) for result in results]
    return rate(sum(answers), len(answers))


def median_of(values: Sequence[float]) -> IntervalEstimate:
    """A median with the interval between two order statistics, for any distribution."""
    if not values:
        return IntervalEstimate(None, None, None, 0)
    middle = float(np.median(values))
    ends: Any = quantile_test(values, p=0.5, q=middle).confidence_interval(
        CONFIDENCE
    )  # the stubs call it a float
    return IntervalEstimate(middle, _finite(ends.low), _finite(ends.high), len(values))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _plain(value: float | None) -> float | None:
    return None if value is None else float(f"{value:.6g}")
