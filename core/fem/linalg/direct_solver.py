"""Interface of the sparse direct solvers."""

from __future__ import annotations

from typing import Protocol

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["Condensation", "Factor", "NotPositiveDefinite"]


class NotPositiveDefinite(Exception):
    """The matrix has no Cholesky factor, to the factor's precision."""


class Condensation(Protocol):
    """A matrix A of which all unknowns but a few are eliminated (static condensation).

    With o the eliminated unknowns and c the kept ones it solves A x = b where the kept x_c are
    determined by more than A: by contact.

    Attributes:
        matrix: (m, m) Schur complement A_cc - A_co A_oo^-1 A_oc, to the factor's precision.
    """

    matrix: FloatArray

    @property
    def stored(self) -> bool:
        """Whether the factor is still stored; without it nothing can be solved."""
        ...

    def eliminate(self, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Eliminate unknowns of a right side b (n,).

        Returns:
            b_c - A_co A_oo^-1 b_o (m,), and the vector (n,) that `substitute` takes.
        """
        ...

    def substitute(self, partial: FloatArray, values: FloatArray) -> FloatArray:
        """Find the eliminated unknowns for values (m,) of the kept ones; returns all x (n,)."""
        ...


class Factor(Protocol):
    """Factors of symmetric positive definite matrices with one pattern, analysed once.

    Single precision is sufficient for a block: at nu = 0.4999, the largest value of a Setup,
    replays take the same Newton steps as with double.

    Attributes:
        generation: number of the factor that is stored.
    """

    generation: int

    def factorise(self, data: FloatArray) -> None:
        """Factorise the matrix with these entries of its upper triangle; raises
        NotPositiveDefinite.
        """

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        ...

    def approximate(self, right: FloatArray) -> FloatArray:
        """Solve to the factor's own precision: five digits in single precision.

        That serves where the next residual corrects the error.
        """
        ...

    def condense(self, data: FloatArray, unknowns: IntArray) -> Condensation:
        """Condense a matrix on some of its unknowns; raises NotPositiveDefinite.

        What is eliminated must be positive definite; the Schur complement need not be.

        Args:
            data: entries of its upper triangle.
            unknowns: (m,) that are kept, one at least.
        """
        ...
