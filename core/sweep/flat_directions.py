"""The error of a sweep along each parameter: how much it changes, and where it is least.

Changes are compared with their bootstrap distribution over whole pushes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.diagnosis.criteria.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray
from palpate.sweep.sweep_error import error_from_sums

__all__ = ["Direction", "assess_direction", "assess_gain"]

_DRAWS, _LEVEL = 2000, 0.05
"""Bootstrap samples, and the significance level before the Bonferroni correction [1]."""
_SMALLEST_CHANGE = 1e-6
"""Changes of the error below this [m] count as none: the solver's tolerance allows them."""


@dataclass(frozen=True)
class Direction:
    """The error along one parameter.

    Attributes:
        name: the parameter, as `effect.parameter`.
        values: (k) values of the parameter [its own unit].
        errors: (k) errors at these values [m].
        change: error at the worst value minus error at the best [m].
        low: lower end of the change's confidence interval [m].
        high: upper end of the change's confidence interval [m].
        flat: whether the change may be zero; None with fewer than two pushes, which cannot be
            resampled.
        size: RMS of the error that the best value removes from that of the worst [m].
        little: whether that is below the size from which a structured error matters.
        least: lower and upper end of the value at which the error is least, 95 % of the resampled
            pushes; None where it is flat or unknown.
        edge: "low" or "high" where the error is least at that end of the range, else empty.
    """

    name: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    change: float
    low: float
    high: float
    flat: bool | None
    size: float
    little: bool
    least: tuple[float, float] | None
    edge: str

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        least = None if self.least is None else list(self.least)
        return {
            **vars(self),
            "values": list(self.values),
            "errors": list(self.errors),
            "least": least,
        }


def assess_direction(
    name: str, values: Sequence[float], sums: FloatArray, measure: str, seed: int
) -> Direction:
    """Test whether the error changes along a parameter, and where it is least.

    The same pushes are drawn for all values, so the variation they have in common cancels. The
    best and the worst value are selected on the same data; the level of the interval is therefore
    divided by the number of possible choices (Bonferroni).

    Args:
        name: the parameter.
        values: (k) values of the parameter, increasing.
        sums: (k, p, 4) sums over each of p pushes at each value, see `palpate.sweep.sweep_error`.
        measure: "distance" or "paper", see `error_from_sums`.
        seed: seed of the bootstrap.
    """
    whole = error_from_sums(sums.sum(axis=1), measure)
    best, worst = int(whole.argmin()), int(whole.argmax())
    change, probes = float(whole[worst] - whole[best]), sums.shape[1]
    drawn = np.random.default_rng(seed).integers(0, probes, size=(_DRAWS, probes))
    errors = np.array([error_from_sums(one[drawn].sum(axis=1), measure) for one in sums])
    level = _LEVEL / max(1, len(values) - 1)
    low, high = (
        float(edge)
        for edge in np.quantile(errors[worst] - errors[best], [level / 2, 1 - level / 2])
    )
    flat: bool | None = change < _SMALLEST_CHANGE or low < _SMALLEST_CHANGE
    if probes < 2 and change >= _SMALLEST_CHANGE:
        flat = None
    size = float(np.sqrt(max(0.0, whole[worst] ** 2 - whole[best] ** 2)))
    known = flat is False
    return Direction(
        name,
        tuple(values),
        tuple(whole.tolist()),
        change,
        low,
        high,
        flat,
        size,
        size < CRITERIA.verdict.tolerance,
        _least(np.asarray(values, dtype=float), errors) if known else None,
        {0: "low", len(values) - 1: "high"}.get(best, "") if known else "",
    )


def assess_gain(
    before: FloatArray, after: FloatArray, choices: int, measure: str, seed: int
) -> dict[str, float]:
    """Compare the error of the stated setup with that of the best of several points.

    Args:
        before: (p, 4) sums over each push of the stated setup.
        after: (p, 4) the same of the best point.
        choices: number of points that it was chosen from; the level is divided by it.
        measure: see `error_from_sums`.
        seed: seed of the bootstrap.

    Returns:
        `value` of the difference [m], and the ends `low` and `high` of its interval.
    """
    probes = len(before)
    drawn = np.random.default_rng(seed).integers(0, probes, size=(_DRAWS, probes))
    draws = error_from_sums(before[drawn].sum(axis=1), measure) - error_from_sums(
        after[drawn].sum(axis=1), measure
    )
    value = error_from_sums(before.sum(axis=0), measure) - error_from_sums(
        after.sum(axis=0), measure
    )
    level = _LEVEL / max(1, choices)
    low, high = np.quantile(draws, [level / 2, 1 - level / 2])
    if probes < 2:
        low, high = -np.inf, np.inf
    return {"value": float(value), "low": float(low), "high": float(high)}


def _least(values: FloatArray, errors: FloatArray) -> tuple[float, float]:
    """Ends of the value of the least error over draws (k, d), by parabolas through three values."""
    best = errors.argmin(axis=0)
    place = best.astype(float)
    inner = (best > 0) & (best < len(values) - 1)
    at, draw = best[inner], np.flatnonzero(inner)
    before, here, after = (errors[at + step, draw] for step in (-1, 0, 1))
    bend = before - 2 * here + after
    step = np.where(bend > 0, (before - after) / (2 * np.where(bend > 0, bend, 1.0)), 0.0)
    place[inner] += np.clip(step, -0.5, 0.5)
    ends = np.quantile(place, [_LEVEL / 2, 1 - _LEVEL / 2])
    low, high = np.interp(ends, np.arange(len(values)), values)
    return float(low), float(high)
