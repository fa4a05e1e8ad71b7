"""What the engine asks of a sparse direct solver."""

from __future__ import annotations

from typing import Protocol

from core.frames import FloatArray
from core.mesh import IntArray

__all__ = ["Factor", "NotPositiveDefinite"]


class NotPositiveDefinite(Exception):
    """The matrix has no Cholesky factor."""


class Factor(Protocol):
    """Factors of symmetric positive definite matrices that share one pattern, analysed once.

    Attributes:
        generation: number of the factor that is held.
    """

    generation: int

    def factorise(self, data: FloatArray, asked: IntArray | None = None) -> None:
        """Factorise the matrix with these entries of its upper triangle; raises NotPositiveDefinite.

        `answers` between unknowns that are among those `asked` (m,) may be had for less; others are as right.
        """

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        ...

    def answers(self, unknowns: IntArray) -> FloatArray:
        """The inverse's entries (m, m) between these unknowns (m,): how each answers a unit load on each."""
        ...
