"""MKL's Pardiso: the fastest direct solver for systems of this size (shared out by pypardiso)."""

from __future__ import annotations

import ctypes
import logging
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

log = logging.getLogger(__name__)

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _RELEASE = 11, 22, 33, 331, -1
_ZERO_PIVOT = -4
_DOMAIN = 4
"""MKL's number for Pardiso where threads are set by domain."""
_CHOSEN, _ORDERING, _ALGORITHM, _PARTIAL = 0, 1, 23, 30
_NESTED_DISSECTION, _TWO_LEVEL, _SPARSE_RIGHT_SIDES = 2, 1, 1
_NONE = np.empty(0, dtype=np.int64)
_SAME = 1e-9
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
    """One matrix in MKL's memory, with everything its calls need that does not change between them.

    Args:
        pattern: as of `Pardiso`. asked: (m,) unknowns between which entries of the inverse will be wanted.
    """

    def __init__(self, pattern: sp.csr_matrix, asked: IntArray) -> None:
        self.matrix = pattern
        self.size = pattern.shape[0]
        self.rows = pattern.indptr.astype(np.int32) + 1
        self.columns = pattern.indices.astype(np.int32) + 1
        self.memory = np.zeros(64, dtype=np.int64)
        self.options = np.zeros(64, dtype=np.int32)
        # MKL's own defaults refine every solution, which a Cholesky factor does not need: a solve takes three times as long.
        self.options[_CHOSEN], self.options[_ORDERING] = 1, _NESTED_DISSECTION
        self.order = np.zeros(self.size, dtype=np.int32)
        self.asked = np.zeros(self.size, dtype=bool)
        self.asked[asked] = True
        if len(asked):
            # Of MKL's two ways to factorise, the usual one answers sparse right sides wrongly, and takes ten times as long.
            self.options[_ALGORITHM] = _TWO_LEVEL
        self.call = _pardiso()
        self.run(_ANALYSE, np.zeros(self.size), asked)

    def run(self, phase: int, right: FloatArray, sparse: IntArray = _NONE) -> FloatArray:
        """Carry out a phase; returns the solution (n,) or (n, m) in column order where the phase has one.

        Of right sides that are empty but in the unknowns `sparse` the solution is right only there. These are among those asked
        for, all of which are to be named when the matrix is analysed and when it is factorised.
        """
        self.options[_PARTIAL] = _SPARSE_RIGHT_SIDES if len(sparse) else 0
        self.order[:] = 0
        self.order[sparse] = 1
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
        self._idle = np.zeros(pattern.shape[0])
        self.generation = 0
        self._trusted, self._current = True, False
        self._analyse(_NONE)

    def _analyse(self, asked: IntArray) -> None:
        """Analyse the pattern, with cheap answers between these unknowns (m,): in which order they are eliminated hangs on it."""
        self._handle, self._asked, self._checked = _Handle(self._matrix, asked), asked, False
        self._forget = weakref.finalize(self, _release, self._handle)
        # At interpreter exit the memory goes anyway, and the library may be gone first.
        self._forget.atexit = False

    def factorise(self, data: FloatArray, asked: IntArray | None = None) -> None:
        """Factorise the matrix with these entries of its upper triangle; raises NotPositiveDefinite.

        `answers` between unknowns that are all among those `asked` (m,) take a fifth of the time; asking for others than the last
        time takes an analysis. The factor there is stays where it is of these very entries.
        """
        wanted = asked if asked is not None and self._trusted else _NONE
        same = np.array_equal(wanted, self._asked)
        if same and self._current and np.array_equal(data, self._matrix.data):
            return
        self.generation += 1
        self._current = False
        if not same:
            self._forget()
            self._analyse(wanted)
        self._matrix.data[:] = data
        self._handle.run(_FACTORISE, self._idle, self._asked)
        self._current = True

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        return np.ascontiguousarray(self._handle.run(_SOLVE, np.asfortranarray(right, dtype=float)))

    def answers(self, unknowns: IntArray) -> FloatArray:
        """The inverse's entries (m, m) between these unknowns (m,): with A = L L^T they are those of Y^T Y, Y = L^-1 of unit loads.

        Half a solution is half the work, and most rows of Y are empty; but where these unknowns were asked for, MKL passes over all
        that is empty itself.
        """
        if not len(unknowns):
            return np.empty((0, 0))
        unit = np.zeros((self._handle.size, len(unknowns)), order="F")
        unit[unknowns, np.arange(len(unknowns))] = 1.0
        if self._handle.asked[unknowns].all():
            found = self._handle.run(_SOLVE, unit, unknowns)[unknowns]
            if self._believed(found, unknowns):
                return found
        half = self._handle.run(_FORWARD, unit)
        filled = half[half.any(axis=1)]
        return np.asarray(filled.T @ filled)

    def _believed(self, found: FloatArray, unknowns: IntArray) -> bool:
        """Whether cheap answers (m, m) are those of a whole solution: looked at once after each analysis, for one of them."""
        if not self._checked:
            load = self._idle.copy()
            load[unknowns[0]] = 1.0
            whole = self.solve(load)[unknowns]
            self._checked = True
            self._trusted = bool(np.abs(found[:, 0] - whole).max() <= _SAME * np.abs(whole).max())
            if not self._trusted:
                log.warning("MKL's answers to sparse loads are wrong on this machine: they are done without, which takes longer")
        return self._trusted
