"""Along which parameters the error says nothing: it changes there by no more than resampling whole
probes lets it.
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
_LEAST = 1e-6
"""Of the error [m]: what the solver's own tolerance leaves is no change."""


@dataclass(frozen=True)
class Direction:
    """What one parameter does to the error.

    Attributes:
        values: (k) along it.
        errors: (k) [m] there.
        change: of the error [m] from the best value to the worst;
        low, high: its interval.
        flat: whether it may be nothing. None where fewer than two probes were compared, so that
            nobody knows.
    """

    name: str
    values: tuple[float, ...]
    errors: tuple[float, ...]
    change: float
    low: float
    high: float
    flat: bool | None

    def to_json(self) -> dict[str, Any]:
        """Plain values."""
        return {**vars(self), "values": list(self.values), "errors": list(self.errors)}


def assess_direction(
    name: str, values: Sequence[float], sums: FloatArray, measure: str, seed: int
) -> Direction:
    """From the sums (k, probes, 4) of `palpate.sweep.sweep_error` at k values of a parameter.

    The same probes are drawn for all values, so what they share cancels. The best and the worst
    value are chosen from these same data, therefore the interval's level is shared out over all
    that could have been chosen (Bonferroni).
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
    flat: bool | None = change < _LEAST or low < _LEAST
    if probes < 2 and change >= _LEAST:
        flat = None
    return Direction(name, tuple(values), tuple(whole.tolist()), change, low, high, flat)
