"""Sparse symmetric systems with one pattern: analysed once, factorised often (MKL Pardiso: Cholesky, else LDL^T)."""

from __future__ import annotations

import ctypes
import weakref
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from core.frames import FloatArray
from core.mesh import IntArray

__all__ = ["NotPositiveDefinite", "SparseCholesky"]

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1
_ZERO_PIVOT = -4
_CHOSEN, _ORDERING = 0, 1
_NESTED_DISSECTION = 2
_DOUBLES, _INTEGERS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int32)


class NotPositiveDefinite(Exception):
    """The matrix has no Cholesky factor."""


@lru_cache(maxsize=1)
def _pardiso() -> Any:
    """MKL's entry point; looking for the library takes most of a second, so it is done once."""
    from pypardiso import PyPardisoSolver  # noqa: PLC0415 (heavy)

    return PyPardisoSolver()._mkl_pardiso


def _aligned(right: FloatArray) -> FloatArray:
    """A copy that begins at a cache line: MKL's last digits depend on where an array lies."""
    memory = np.empty(right.size + 8)
    begin = -memory.ctypes.data // 8 % 8
    copy = memory[begin : begin + right.size].reshape(right.shape, order="F")
    copy[...] = right
    return copy


class _Handle:
    """One matrix in MKL's memory, with everything its calls need that does not change between them."""

    def __init__(self, pattern: sp.csr_matrix) -> None:
        self.matrix = pattern
        self.size = pattern.shape[0]
        self.rows = pattern.indptr.astype(np.int32) + 1
        self.columns = pattern.indices.astype(np.int32) + 1
        self.memory = np.zeros(64, dtype=np.int64)
        self.options = np.zeros(64, dtype=np.int32)
        # MKL's own defaults refine every solution, which a Cholesky factor does not need: a solve takes three times as long.
        self.options[_CHOSEN], self.options[_ORDERING] = 1, _NESTED_DISSECTION
        self.order = np.zeros(self.size, dtype=np.int32)
        self.call = _pardiso()

    def run(self, phase: int, right: FloatArray) -> FloatArray:
        """Carry out a phase; returns the solution (n,) or (n, m) in column order where the phase has one."""
        solution, error = _aligned(right), ctypes.c_int32(0)
        right = _aligned(right)
        number = [ctypes.byref(ctypes.c_int32(value)) for value in (1, _POSITIVE_DEFINITE, phase, self.size)]
        columns = ctypes.byref(ctypes.c_int32(1 if right.ndim == 1 else right.shape[1]))
        self.call(
            self.memory.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), number[0], number[0], number[1], number[2], number[3],
            self.matrix.data.ctypes.data_as(_DOUBLES), self.rows.ctypes.data_as(_INTEGERS), self.columns.ctypes.data_as(_INTEGERS),
            self.order.ctypes.data_as(_INTEGERS), columns, self.options.ctypes.data_as(_INTEGERS), ctypes.byref(ctypes.c_int32(0)),
            right.ctypes.data_as(_DOUBLES), solution.ctypes.data_as(_DOUBLES), ctypes.byref(error),
        )  # fmt: skip
        if error.value == _ZERO_PIVOT:
            raise NotPositiveDefinite("the matrix has no Cholesky factor")
        if error.value:
            raise RuntimeError(f"MKL Pardiso failed in phase {phase} with error {error.value}")
        return solution


def _release(handle: _Handle) -> None:
    handle.run(_RELEASE, np.zeros(handle.size))


class SparseCholesky:
    """Cholesky factors of matrices that share one pattern.

    Args:
        pattern: upper triangle (with diagonal) in CSR form, indices sorted; its `data` is the array that is factorised.

    Attributes:
        generation: number of the factor that is held.
    """

    def __init__(self, pattern: sp.csr_matrix) -> None:
        self._matrix = pattern
        self._handle = _Handle(pattern)
        self._idle = np.zeros(pattern.shape[0])
        self.generation = 0
        self._handle.run(_ANALYSE, self._idle)
        # At interpreter exit the memory goes anyway, and the library may be gone first.
        weakref.finalize(self, _release, self._handle).atexit = False

    def factorise(self, data: FloatArray) -> None:
        """Factorise the matrix with these entries; raises NotPositiveDefinite."""
        self.generation += 1
        self._matrix.data[:] = data
        self._handle.run(_FACTORISE, self._idle)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        return np.ascontiguousarray(self._handle.run(_SOLVE, np.asfortranarray(right, dtype=float)))


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
