"""Static condensation by whole solutions, for solvers that have no other."""

from __future__ import annotations

import numpy as np

from palpate.fem.linalg.direct_solver import Factor
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["SolvedCondensation"]


class SolvedCondensation:
    """A `Condensation` by the responses to unit loads.

    Args:
        factor: of the matrix.
        size: of the matrix.
        unknowns: (m,) that are not eliminated.
    """

    def __init__(self, factor: Factor, size: int, unknowns: IntArray) -> None:
        self._factor, self._unknowns, self._generation = factor, unknowns, factor.generation
        unit = np.zeros((size, len(unknowns)), order="F")
        unit[unknowns, np.arange(len(unknowns))] = 1.0
        self._responses = factor.approximate(unit)
        inverse = self._responses[unknowns]
        self.matrix = np.asarray(np.linalg.inv((inverse + inverse.T) / 2), dtype=float)

    @property
    def stored(self) -> bool:
        """Whether the factor is still stored."""
        return self._factor.generation == self._generation

    def eliminate(self, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Eliminate; see `Condensation`."""
        whole = self._factor.approximate(right)
        return np.asarray(self.matrix @ whole[self._unknowns]), whole

    def substitute(self, partial: FloatArray, values: FloatArray) -> FloatArray:
        """Substitute back; see `Condensation`."""
        load = self.matrix @ (values - partial[self._unknowns])
        return np.asarray(partial + self._responses @ load)
