"""Flat directions of a sweep: parameters along which the error does not change significantly.

The change is compared with its bootstrap distribution over whole pushes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.sweep.sweep_error import error_from_sums

__all__ = ["Direction", "assess_direction"]

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
    """

    name: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    change: float
    low: float
    high: float
    flat: bool | None

    def to_json(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**vars(self), "values": list(self.values), "errors": list(self.errors)}


def assess_direction(
    name: str, values: Sequence[float], sums: FloatArray, measure: str, seed: int
) -> Direction:
    """Test whether the error changes along a parameter.

    The same pushes are drawn for all values, so the variation they have in common cancels. The
    best and the worst value are selected on the same data; the level of the interval is therefore
    divided by the number of possible choices (Bonferroni).

    Args:
        name: the parameter.
        values: (k) values of the parameter.
        sums: (k, p, 4) sums over each of p pushes at each value, see `palpate.sweep.sweep_error`.
        measure: "distance" or "paper", see `error_from_sums`.
        seed: seed of the bootstrap.
    """
    whole = error_from_sums(sums.sum(axis=1), measure)
    best, worst = int(whole.argmin()), int(whole.argmax())
    change, probes = float(whole[worst] - whole[best]), sums.shape[1]
    drawn = np.random.default_rng(seed).integers(0, probes, size=(_DRAWS, probes))
    differences = error_from_sums(sums[worst][drawn].sum(axis=1), measure) - error_from_sums(
        sums[best][drawn].sum(axis=1), measure
    )
    level = _LEVEL / max(1, len(values) - 1)
    low, high = (float(edge) for edge in np.quantile(differences, [level / 2, 1 - level / 2]))
    flat: bool | None = change < _SMALLEST_CHANGE or low < _SMALLEST_CHANGE
    if probes < 2 and change >= _SMALLEST_CHANGE:
        flat = None
    return Direction(name, tuple(values), tuple(whole.tolist()), change, low, high, flat)
