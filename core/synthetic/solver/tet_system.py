"""Linear systems of the virtual block with one sparsity pattern, factored by MKL's Pardiso."""

from __future__ import annotations

from copy import copy
from functools import cache
from typing import Any

import numpy as np
from scipy import sparse

from palpate.foundation.arrays import FloatArray
from palpate.foundation.mkl_library import name_library
from palpate.synthetic.solver.tet_block import IntArray

__all__ = ["TetSystem"]


class TetSystem:
    """The upper triangle of the tangent in one fixed pattern, and its factor."""

    def __init__(self, elements: IntArray, free: IntArray) -> None:
        count = int(free.max()) + 1
        local = free[elements]
        low = np.minimum(local[:, :, None], local[:, None, :])
        high = np.maximum(local[:, :, None], local[:, None, :])
        upper = np.triu(np.ones((10, 10), dtype=bool))
        used = (low >= 0) & upper
        keys, blocks = np.unique(low[used] * count + high[used], return_inverse=True)
        rows, columns = keys // count, keys % count
        per_row = np.bincount(rows, minlength=count)
        first = np.concatenate([[0], np.cumsum(per_row)])
        lengths = np.repeat(3 * per_row, 3) - np.tile([0, 1, 2], count)
        pointers = np.concatenate([[0], np.cumsum(lengths)])
        rank = np.arange(len(keys)) - first[rows]
        i, k = np.indices((3, 3))
        target = pointers[3 * rows][:, None, None]
        target = pointers[3 * rows[:, None, None] + i] + 3 * rank[:, None, None] + k - i
        target = np.where((rows == columns)[:, None, None] & (k < i), -1, target)
        indices = np.empty(pointers[-1], dtype=np.int32)
        valid = target >= 0
        indices[target[valid]] = np.broadcast_to(3 * columns[:, None, None] + k, target.shape)[
            valid
        ]
        swapped = np.broadcast_to((local[:, :, None] > local[:, None, :]), used.shape)[used]
        scatter = np.where(
            swapped[:, None, None], np.swapaxes(target[blocks], 1, 2), target[blocks]
        )
        self._used = np.nonzero(used.ravel())[0]
        self._scatter = np.where(scatter < 0, pointers[-1], scatter).ravel()
        self._matrix = sparse.csr_matrix(
            (np.zeros(pointers[-1]), indices, pointers.astype(np.int32)),
            shape=(3 * count, 3 * count),
        )
        self._solver = _pardiso()
        self._analysed = False

    def factorise(self, stiffness: FloatArray) -> None:
        """Assemble and factor element stiffness (e, 10, 10, 3, 3) [N/m]."""
        blocks = stiffness.reshape(-1, 9)[self._used].ravel()
        size = len(self._matrix.data)
        self._matrix.data[:] = np.bincount(self._scatter, weights=blocks, minlength=size + 1)[:size]
        right = np.zeros((self._matrix.shape[0], 1))
        if not self._analysed:
            self._solver.set_phase(11)
            self._solver._call_pardiso(self._matrix, right)
            self._analysed = True
        self._solver.set_phase(22)
        self._solver._call_pardiso(self._matrix, right)

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues of the factored matrix."""
        return int(self._solver.get_iparm(23))

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve with the last factor for right-hand sides (3 free,) or (3 free, k)."""
        self._solver.set_phase(33)
        return np.asarray(
            self._solver._call_pardiso(
                self._matrix, np.asfortranarray(right.reshape(len(right), -1))
            )
        ).reshape(right.shape)

    def close(self) -> None:
        """Free the factor's memory."""
        self._solver.free_memory(everything=True)


@cache
def _library() -> Any:
    name_library()
    from pypardiso import PyPardisoSolver

    return PyPardisoSolver(mtype=-2)


def _pardiso() -> Any:
    """A new solver that shares the loaded library; loading takes longer than a factorisation."""
    solver = copy(_library())
    solver.pt, solver.iparm, solver.perm = solver.pt * 0, solver.iparm * 0, solver.perm.copy()
    return solver
