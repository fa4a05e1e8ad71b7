"""What the engine asks of a sparse direct solver."""

from __future__ import annotations

from typing import Protocol

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["Factor", "NotPositiveDefinite"]


class NotPositiveDefinite(Exception):
    """The matrix has no Cholesky factor, to the precision that the factor has."""


class Factor(Protocol):
    """Factors of symmetric positive definite matrices that share one pattern, analysed once.

    Single precision is enough for a block's: at nu = 0.4999, the most that a Setup takes, replays
    take the same Newton steps as with double.

    Attributes:
        generation: number of the factor that is held.
    """

    generation: int

    def factorise(self, data: FloatArray, requested: IntArray | None = None) -> None:
        """Factorise the matrix with these entries of its upper triangle; raises
        NotPositiveDefinite.

        `inverse_entries` between unknowns that are among those `requested` (m,) may be had for less; others are
        as right.
        """

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        ...

    def approximate(self, right: FloatArray) -> FloatArray:
        """The same to the factor's own precision: five digits of a single one, for what the next
        residual sets right.
        """
        ...

    def inverse_entries(self, unknowns: IntArray) -> FloatArray:
        """The inverse's entries (m, m) between these unknowns (m,): how each answers to a unit
        load, to the factor's precision.
        """
        ...
