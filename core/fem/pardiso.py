"""MKL's Pardiso: the fastest direct solver for systems of this size (shared out by pypardiso)."""

from __future__ import annotations

import ctypes
import math
import os
import sys
import weakref
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from core.fem.factor import NotPositiveDefinite
from core.frames import FloatArray
from core.mesh import IntArray

__all__ = ["Pardiso"]

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _RELEASE = 11, 22, 33, 331, -1
_ZERO_PIVOT = -4
_DOMAIN = 4
"""MKL's number for Pardiso where threads are set by domain."""
_CHOSEN, _ORDERING = 0, 1
_NESTED_DISSECTION = 2
_DOUBLES, _INTEGERS = ctypes.POINTER(ctypes.c_double), ctypes.POINTER(ctypes.c_int32)


@lru_cache(maxsize=1)
def _pardiso() -> Any:
    """MKL's entry point. pypardiso looks through the whole environment for the library, for a second or three in each process."""
    beside = sorted((Path(sys.prefix) / "lib").glob("libmkl_rt.so*"))
    if beside:  # said before the import, which looks for the library already
        os.environ.setdefault("PYPARDISO_MKL_RT", str(beside[0]))
    from pypardiso import PyPardisoSolver  # noqa: PLC0415 (heavy)

    solver = PyPardisoSolver()
    # A factor made by one number of threads and used by another ends the process, as where MKL_NUM_THREADS asks for several and
    # a solve is bounded to one (`core.threads`).
    solver.libmkl.MKL_Domain_Set_Num_Threads(1, _DOMAIN)
    return solver._mkl_pardiso


def _room(shape: tuple[int, ...]) -> FloatArray:
    """An array in column order that begins at a cache line: MKL's last digits depend on where an array lies."""
    size = math.prod(shape)
    memory = np.empty(size + 8)
    begin = -memory.ctypes.data // 8 % 8
    return memory[begin : begin + size].reshape(shape, order="F")


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
        solution, given, error = _room(right.shape), _room(right.shape), ctypes.c_int32(0)
        given[...] = right
        number = [ctypes.byref(ctypes.c_int32(value)) for value in (1, _POSITIVE_DEFINITE, phase, self.size)]
        columns = ctypes.byref(ctypes.c_int32(1 if right.ndim == 1 else right.shape[1]))
        self.call(
            self.memory.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)), number[0], number[0], number[1], number[2], number[3],
            self.matrix.data.ctypes.data_as(_DOUBLES), self.rows.ctypes.data_as(_INTEGERS), self.columns.ctypes.data_as(_INTEGERS),
            self.order.ctypes.data_as(_INTEGERS), columns, self.options.ctypes.data_as(_INTEGERS), ctypes.byref(ctypes.c_int32(0)),
            given.ctypes.data_as(_DOUBLES), solution.ctypes.data_as(_DOUBLES), ctypes.byref(error),
        )  # fmt: skip
        if error.value == _ZERO_PIVOT:
            raise NotPositiveDefinite("the matrix has no Cholesky factor")
        if error.value:
            raise RuntimeError(f"MKL Pardiso failed in phase {phase} with error {error.value}")
        return solution


def _release(handle: _Handle) -> None:
    handle.run(_RELEASE, np.zeros(handle.size))


class Pardiso:
    """As `Factor`.

    Args:
        pattern: upper triangle (with diagonal) in CSR form, indices sorted; its `data` is the array that is factorised.
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
        """Factorise the matrix with these entries of its upper triangle; raises NotPositiveDefinite."""
        self.generation += 1
        self._matrix.data[:] = data
        self._handle.run(_FACTORISE, self._idle)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        return np.ascontiguousarray(self._handle.run(_SOLVE, np.asfortranarray(right, dtype=float)))

    def answers(self, unknowns: IntArray) -> FloatArray:
        """The inverse's entries (m, m) between these unknowns (m,): with A = L L^T they are those of Y^T Y, Y = L^-1 of unit loads.

        Half a solution is half the work, and most rows of Y are empty.
        """
        unit = np.zeros((self._handle.size, len(unknowns)), order="F")
        unit[unknowns, np.arange(len(unknowns))] = 1.0
        half = self._handle.run(_FORWARD, unit)
        filled = half[half.any(axis=1)]
        return np.asarray(filled.T @ filled)
