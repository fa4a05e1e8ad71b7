"""SuperLU, which comes with scipy, for machines without MKL."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from palpate.fem.linalg.direct_solver import Condensation, NotPositiveDefinite
from palpate.fem.linalg.solved_condensation import SolvedCondensation
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["SuperLUFactor"]


class SuperLUFactor:
    """A `Factor` by SuperLU; the pattern is analysed for every matrix, since scipy stores no
    analysis.

    Args:
        pattern: upper triangle (with diagonal) in CSR form, indices sorted.
    """

    def __init__(self, pattern: sp.csr_matrix) -> None:
        upper = sp.csr_matrix(
            (np.arange(1, pattern.nnz + 1), pattern.indices, pattern.indptr), shape=pattern.shape
        )
        whole = sp.csc_matrix(upper + sp.triu(upper, 1).T)
        self._source, self._indices, self._starts, self._shape = (
            whole.data - 1,
            whole.indices,
            whole.indptr,
            pattern.shape,
        )
        self._lu: SuperLU | None = None
        self.generation = 0

    def factorise(self, data: FloatArray) -> None:
        """Factorise the matrix with these entries of its upper triangle; raises
        NotPositiveDefinite.
        """
        self.generation += 1
        matrix = sp.csc_matrix(
            (np.asarray(data, dtype=float)[self._source], self._indices, self._starts),
            shape=self._shape,
        )
        try:
            self._lu = splu(
                matrix,
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:  # an exactly singular matrix
            raise NotPositiveDefinite("the matrix has no Cholesky factor") from error
        # With pivots on the diagonal, as many of them are negative as eigenvalues (Sylvester's law
        # of inertia).
        on_diagonal = np.array_equal(self._lu.perm_r, self._lu.perm_c)
        if not on_diagonal or not (self._lu.U.diagonal() > 0).all():
            raise NotPositiveDefinite("the matrix has no Cholesky factor")

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        if self._lu is None:
            raise RuntimeError("nothing has been factorised yet")
        return np.ascontiguousarray(self._lu.solve(np.asarray(right, dtype=float)))

    def approximate(self, right: FloatArray) -> FloatArray:
        """Solve like `solve`: the factor has double precision."""
        return self.solve(right)

    def condense(self, data: FloatArray, unknowns: IntArray) -> Condensation:
        """Condense the matrix with these entries; see `Factor`. All of it must be positive."""
        self.factorise(data)
        return SolvedCondensation(self, self._shape[0], unknowns)
