"""Sparse symmetric systems with one pattern: analysed once, factorised often (MKL Pardiso: Cholesky, else LDL^T)."""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
import scipy.sparse as sp

from core.frames import FloatArray
from core.mesh import IntArray

__all__ = ["NotPositiveDefinite", "SparseCholesky"]

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1


class NotPositiveDefinite(Exception):
    """The matrix has no Cholesky factor."""


def _release(solver: Any, matrix: sp.csr_matrix) -> None:
    solver.set_phase(_RELEASE)
    solver._call_pardiso(matrix, np.zeros(matrix.shape[0]))


class SparseCholesky:
    """Cholesky factors of matrices that share one pattern.

    Args:
        pattern: upper triangle (with diagonal) in CSR form, indices sorted; its `data` is the array that is factorised.
    """

    def __init__(self, pattern: sp.csr_matrix) -> None:
        from pypardiso import PyPardisoSolver

        self._matrix = pattern
        self._solver = PyPardisoSolver(mtype=_POSITIVE_DEFINITE)
        self._run(_ANALYSE, np.zeros(pattern.shape[0]))
        # At interpreter exit the memory goes anyway, and the library may be gone first.
        weakref.finalize(self, _release, self._solver, pattern).atexit = False

    def _run(self, phase: int, right: FloatArray) -> FloatArray:
        # The public solve() compares and copies the matrix at each call, which costs more than the back substitution.
        self._solver.set_phase(phase)
        return np.asarray(self._solver._call_pardiso(self._matrix, right))

    def factorise(self, data: FloatArray) -> None:
        """Factorise the matrix with these entries; raises NotPositiveDefinite."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._matrix.data[:] = data
        try:
            self._run(_FACTORISE, np.zeros(self._matrix.shape[0]))
        except PyPardisoError as error:
            raise NotPositiveDefinite(str(error)) from None

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        return self._run(_SOLVE, np.asfortranarray(right))


def upper_pattern(elements: IntArray, unknown: IntArray) -> tuple[sp.csr_matrix, IntArray]:
    """Pattern of the stiffness matrix of the unknowns, and where each entry of each element's matrix belongs in its data.

    Args:
        elements: (e, a) nodes.
        unknown: (n, 3) number of the unknown of each node and axis; -1 where the displacement is given.

    Returns:
        upper triangle in CSR form; (e, 3a, 3a) slots, -1 below the diagonal and for given displacements.
    """
    numbers = unknown[elements].reshape(len(elements), -1)
    rows = np.repeat(numbers, numbers.shape[1], axis=1).ravel()
    columns = np.tile(numbers, (1, numbers.shape[1])).ravel()
    used = (rows >= 0) & (columns >= rows)
    count = int(unknown.max()) + 1
    keys, inverse = np.unique(rows[used].astype(np.int64) * count + columns[used], return_inverse=True)
    slots = np.full(len(rows), -1, dtype=np.int32)
    slots[used] = inverse
    indptr = np.searchsorted(keys // count, np.arange(count + 1))
    pattern = sp.csr_matrix((np.zeros(len(keys)), keys % count, indptr), shape=(count, count))
    return pattern, slots.reshape(len(elements), numbers.shape[1], numbers.shape[1])


def face_slots(pattern: sp.csr_matrix, faces: IntArray, unknown: IntArray) -> IntArray:
    """As the slots of `upper_pattern`, for faces (f, a) whose nodes share an element."""
    numbers = unknown[faces].reshape(len(faces), -1)
    rows = np.repeat(numbers, numbers.shape[1], axis=1).ravel()
    columns = np.tile(numbers, (1, numbers.shape[1])).ravel()
    used = (rows >= 0) & (columns >= rows)
    count = pattern.shape[0]
    keys = np.repeat(np.arange(count, dtype=np.int64), np.diff(pattern.indptr)) * count + pattern.indices
    slots = np.full(len(rows), -1, dtype=np.int32)
    slots[used] = np.searchsorted(keys, rows[used].astype(np.int64) * count + columns[used])
    return slots.reshape(len(faces), numbers.shape[1], numbers.shape[1])
