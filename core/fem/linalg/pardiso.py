"""MKL's Pardiso, the fastest direct solver for systems of this size (distributed by pypardiso)."""

from __future__ import annotations

import ctypes
import logging
import math
import weakref
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.mkl_library import name_library

__all__ = ["Pardiso"]

log = logging.getLogger(__name__)

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _RELEASE = 11, 22, 33, 331, -1
_ZERO_PIVOT = -4
_DOMAIN = 4
"""MKL's domain number of Pardiso, for thread settings."""
_CHOSEN, _ORDERING, _ALGORITHM, _PRECISION, _PARTIAL = 0, 1, 23, 27, 30
_NESTED_DISSECTION, _TWO_LEVEL, _SINGLE, _SPARSE_RIGHT_SIDES = 2, 1, 1, 1
_NONE = np.empty(0, dtype=np.int64)
_SAME = {np.dtype(np.float32): 1e-3, np.dtype(np.float64): 1e-9}
"""Fast inverse entries are correct to this share of the largest [1]."""
_SETTLED, _MOST_ROUNDS = 1e-5, 10
"""A solution is refined until it changes by no more than this share of it, and at most so many
rounds; each round reduces the error by the same factor."""
_ANY, _INTEGERS = ctypes.c_void_p, ctypes.POINTER(ctypes.c_int32)


@lru_cache(maxsize=1)
def _pardiso() -> Any:
    """MKL's entry point."""
    name_library()
    from pypardiso import PyPardisoSolver

    solver = PyPardisoSolver()
    # A factor made with one number of threads and used with another ends the process, as when
    # MKL_NUM_THREADS requests several and a solve is limited to one (`palpate.foundation.threads`).
    solver.libmkl.MKL_Domain_Set_Num_Threads(1, _DOMAIN)
    return solver._mkl_pardiso


def _aligned_array(shape: tuple[int, ...], kind: np.dtype[Any]) -> Any:
    """An array in column order that begins at a cache line: MKL's last digits depend on the
    address.
    """
    size, line = math.prod(shape), 64 // kind.itemsize
    memory = np.empty(size + line, dtype=kind)
    begin = -memory.ctypes.data // kind.itemsize % line
    return memory[begin : begin + size].reshape(shape, order="F")


class _Handle:
    """One matrix in MKL's memory, with the constant arguments of its calls.

    Args:
        pattern: as of `Pardiso`.
        requested: (m,) unknowns between which entries of the inverse are needed.
        single: precision.
    """

    def __init__(self, pattern: sp.csr_matrix, requested: IntArray, single: bool) -> None:
        self.kind: np.dtype[Any] = np.dtype(np.float32 if single else np.float64)
        self.entries = np.asarray(pattern.data, dtype=self.kind)
        self.size = pattern.shape[0]
        self.rows = pattern.indptr.astype(np.int32) + 1
        self.columns = pattern.indices.astype(np.int32) + 1
        self.memory = np.zeros(64, dtype=np.int64)
        self.options = np.zeros(64, dtype=np.int32)
        # MKL's defaults refine every solution, which a Cholesky factor does not need; a solve takes
        # three times as long with them.
        self.options[_CHOSEN], self.options[_ORDERING] = 1, _NESTED_DISSECTION
        self.options[_PRECISION] = _SINGLE if single else 0
        self.order = np.zeros(self.size, dtype=np.int32)
        self.requested = np.zeros(self.size, dtype=bool)
        self.requested[requested] = True
        if len(requested):
            # MKL's usual factorisation solves sparse right sides wrongly, and takes ten times as
            # long.
            self.options[_ALGORITHM] = _TWO_LEVEL
        self.call = _pardiso()
        self.run(_ANALYSE, np.zeros(self.size), requested)

    def run(self, phase: int, right: FloatArray, sparse: IntArray = _NONE) -> FloatArray:
        """Carry out a phase.

        Args:
            phase: MKL's number of it.
            right: right sides (n,) or (n, m).
            sparse: unknowns outside which the right sides are zero, and for which alone the
                solution is correct. They are among the requested ones, which must be passed to
                analysis and factorisation.

        Returns:
            the solution (n,) or (n, m) in column order and this precision, if the phase has one.
        """
        self.options[_PARTIAL] = _SPARSE_RIGHT_SIDES if len(sparse) else 0
        self.order[:] = 0
        self.order[sparse] = 1
        solution, given, error = (
            _aligned_array(right.shape, self.kind),
            _aligned_array(right.shape, self.kind),
            ctypes.c_int32(0),
        )
        given[...] = right
        number = [
            ctypes.byref(ctypes.c_int32(value))
            for value in (1, _POSITIVE_DEFINITE, phase, self.size)
        ]
        columns = ctypes.byref(ctypes.c_int32(1 if right.ndim == 1 else right.shape[1]))
        self.call(
            self.memory.ctypes.data_as(ctypes.POINTER(ctypes.c_int64)),
            number[0],
            number[0],
            number[1],
            number[2],
            number[3],
            self.entries.ctypes.data_as(_ANY),
            self.rows.ctypes.data_as(_INTEGERS),
            self.columns.ctypes.data_as(_INTEGERS),
            self.order.ctypes.data_as(_INTEGERS),
            columns,
            self.options.ctypes.data_as(_INTEGERS),
            ctypes.byref(ctypes.c_int32(0)),
            given.ctypes.data_as(_ANY),
            solution.ctypes.data_as(_ANY),
            ctypes.byref(error),
        )
        if error.value == _ZERO_PIVOT:
            raise NotPositiveDefinite("the matrix has no Cholesky factor")
        if error.value:
            raise RuntimeError(f"MKL Pardiso failed in phase {phase} with error {error.value}")
        return np.asarray(solution)


def _release(handle: _Handle) -> None:
    handle.run(_RELEASE, np.zeros(handle.size))


class Pardiso:
    """A `Factor` by MKL.

    A single-precision factor takes half the time and memory. The residual, computed in double
    precision, is solved for again until the solution has double precision (iterative refinement:
    Higham and Mary 2022, Acta Numerica 31, section 7).

    Args:
        pattern: upper triangle (with diagonal) in CSR form, indices sorted; its `data` is the array
            that is factorised.
        single: precision of the factor.
    """

    _handle: _Handle

    def __init__(self, pattern: sp.csr_matrix, single: bool = False) -> None:
        self._matrix, self._single = pattern, single
        self._idle = np.zeros(pattern.shape[0])
        self.generation = 0
        self._trusted, self._current = True, False
        _pardiso()  # where it is missing, that is said here and now
        self._requested: IntArray | None = None

    def _analyse(self, requested: IntArray) -> None:
        """Analyse the pattern for fast inverse entries between these unknowns (m,).

        The elimination order depends on them.
        """
        self._handle, self._requested, self._checked = (
            _Handle(self._matrix, requested, self._single),
            requested,
            False,
        )
        self._forget = weakref.finalize(self, _release, self._handle)
        # At interpreter exit the memory goes anyway, and the library may be gone first.
        self._forget.atexit = False

    def factorise(self, data: FloatArray, requested: IntArray | None = None) -> None:
        """Factorise the matrix; raises NotPositiveDefinite.

        Requested inverse entries take a fifth of the time; requesting others than the last time
        takes an analysis. An existing factor of exactly these entries is kept.

        Args:
            data: entries of its upper triangle.
            requested: (m,) unknowns between which `inverse_entries` should be fast.
        """
        current = requested if requested is not None and self._trusted else _NONE
        same = self._requested is not None and np.array_equal(current, self._requested)
        if same and self._current and np.array_equal(data, self._matrix.data):
            return
        self.generation += 1
        self._current = False
        if not same:
            if self._requested is not None:
                self._forget()
            self._analyse(current)
        self._matrix.data[:] = data
        self._handle.entries[:] = data
        self._handle.run(_FACTORISE, self._idle, current)
        self._current = True

    def approximate(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides, to the factor's precision."""
        return np.ascontiguousarray(self._handle.run(_SOLVE, right), dtype=float)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        solution = self.approximate(right)
        for _ in range(_MOST_ROUNDS if self._single else 0):
            change = self.approximate(right - self._times(solution))
            solution += change
            if (np.abs(change).max(axis=0) <= _SETTLED * np.abs(solution).max(axis=0)).all():
                return solution
        return self._in_double(right) if self._single else solution

    def _times(self, vectors: FloatArray) -> FloatArray:
        """Multiply the matrix by one (n,) or several (n, m) vectors."""
        upper = self._matrix
        diagonal = upper.data[upper.indptr[:-1]]
        return np.asarray(upper @ vectors + upper.T @ vectors - (diagonal * vectors.T).T)

    def _in_double(self, right: FloatArray) -> FloatArray:
        """Solve in double precision from now on, for matrices too ill-conditioned for single."""
        log.warning(
            "a stiffness matrix is too ill-conditioned for single precision: solving in double "
            "takes about twice as long"
        )
        self._forget()
        self._single, self._current, requested = False, False, self._requested
        self._requested = None
        self.factorise(self._matrix.data, requested)
        return self.solve(right)

    def inverse_entries(self, unknowns: IntArray) -> FloatArray:
        """Entries of the inverse (m, m) between these unknowns (m,).

        With A = L L^T they are those of Y^T Y, Y = L^-1 of unit loads. Half a solution is half the
        work, and most rows of Y are zero. For requested unknowns MKL itself skips the zeros.
        """
        if not len(unknowns):
            return np.empty((0, 0))
        unit = np.zeros((self._handle.size, len(unknowns)), dtype=self._handle.kind, order="F")
        unit[unknowns, np.arange(len(unknowns))] = 1.0
        if self._handle.requested[unknowns].all():
            solution = self._handle.run(_SOLVE, unit, unknowns)[unknowns]
            if self._is_correct(solution, unknowns):
                return np.asarray(solution, dtype=float)
        half = self._handle.run(_FORWARD, unit)
        filled = half[half.any(axis=1)]
        return np.asarray(filled.T @ filled, dtype=float)

    def _is_correct(self, solution: FloatArray, unknowns: IntArray) -> bool:
        """Whether fast inverse entries (m, m) agree with a full solution.

        One column is checked once after each analysis.
        """
        if not self._checked:
            load = self._idle.copy()
            load[unknowns[0]] = 1.0
            whole = self.approximate(load)[unknowns]
            self._checked = True
            self._trusted = bool(
                np.abs(solution[:, 0] - whole).max()
                <= _SAME[self._handle.kind] * np.abs(whole).max()
            )
            if not self._trusted:
                log.warning(
                    "MKL's answers to sparse loads are wrong on this machine: they are done "
                    "without, which takes longer"
                )
        return self._trusted
