"""Interface of the sparse direct solvers."""

from __future__ import annotations

from typing import Protocol

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["Factor", "NotPositiveDefinite"]


class NotPositiveDefinite(Exception):
    """The matrix has no Cholesky factor, to the factor's precision."""


class Factor(Protocol):
    """Factors of symmetric positive definite matrices with one pattern, analysed once.

    Single precision is sufficient for a block: at nu = 0.4999, the largest value of a Setup,
    replays take the same Newton steps as with double.

    Attributes:
        generation: number of the factor that is stored.
    """

    generation: int

    def factorise(self, data: FloatArray, requested: IntArray | None = None) -> None:
        """Factorise the matrix; raises NotPositiveDefinite.

        Args:
            data: entries of its upper triangle.
            requested: (m,) unknowns between which `inverse_entries` should be fast; others stay
                correct.
        """

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        ...

    def approximate(self, right: FloatArray) -> FloatArray:
        """Solve to the factor's own precision: five digits in single precision.

        That serves where the next residual corrects the error.
        """
        ...

    def inverse_entries(self, unknowns: IntArray) -> FloatArray:
        """Entries of the inverse (m, m) between these unknowns (m,), to the factor's precision.

        They are the responses to unit loads.
        """
        ...
