"""MKL's Pardiso, the fastest direct solver for systems of this size (distributed by pypardiso)."""

from __future__ import annotations

import ctypes
import logging
import math
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp

from palpate.fem.linalg.direct_solver import Condensation, NotPositiveDefinite
from palpate.fem.linalg.solved_condensation import SolvedCondensation
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.mkl_library import name_library

__all__ = ["Pardiso"]

log = logging.getLogger(__name__)

_POSITIVE_DEFINITE = 2
_ANALYSE, _FACTORISE, _SOLVE, _FORWARD, _BACKWARD, _RELEASE = 11, 22, 33, 331, 333, -1
_ZERO_PIVOT = -4
_DOMAIN = 4
"""MKL's domain number of Pardiso, for thread settings."""
_CHOSEN, _ORDERING, _ALGORITHM, _PRECISION, _SCHUR = 0, 1, 23, 27, 35
_NESTED_DISSECTION, _TWO_LEVEL, _SINGLE, _KEPT = 2, 1, 1, 2
_NONE = np.empty(0, dtype=np.int64)
_CORRECT = {np.dtype(np.float32): 1e-3, np.dtype(np.float64): 1e-9}
"""A condensation may leave this share of the load [1]; the factor's precision is far better."""
_CONDENSED_SETS = 2
"""Sets of unknowns whose analysis is stored."""
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
        single: precision.
        kept: (m,) unknowns that are not eliminated: the factorisation returns the Schur complement
            on them.

    Attributes:
        generation: number of the factor that is stored.
        trusted: whether its results were checked, and right; None before the check.
    """

    def __init__(self, pattern: sp.csr_matrix, single: bool, kept: IntArray = _NONE) -> None:
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
        self.options[_ALGORITHM] = _TWO_LEVEL
        self.order = np.zeros(self.size, dtype=np.int32)
        self.order[kept] = 1
        self.options[_SCHUR] = _KEPT if len(kept) else 0
        self.call, self.kept = _pardiso(), kept
        self.generation, self.trusted = 0, None if len(kept) else True
        self.run(_ANALYSE)

    def run(self, phase: int, right: FloatArray | None = None) -> FloatArray:
        """Carry out a phase.

        Args:
            phase: MKL's number of it.
            right: right sides (n,) or (n, m); none are needed unless the phase solves.

        Returns:
            the solution (n,) or (n, m) in column order and this precision; of the factorisation
                the Schur complement (k, k), where unknowns are kept.
        """
        shape = (len(self.kept),) * 2 if right is None else right.shape
        solution, given, error = (
            _aligned_array(shape, self.kind),
            _aligned_array((self.size,) if right is None else shape, self.kind),
            ctypes.c_int32(0),
        )
        given[...] = 0.0 if right is None else right
        number = [
            ctypes.byref(ctypes.c_int32(value))
            for value in (1, _POSITIVE_DEFINITE, phase, self.size)
        ]
        columns = 1 if right is None or right.ndim == 1 else right.shape[1]
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
            ctypes.byref(ctypes.c_int32(columns)),
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

    def factorise(self, data: FloatArray) -> FloatArray:
        """Factorise a matrix with these entries; returns the Schur complement, see `run`."""
        self.generation += 1
        self.entries[:] = data
        return self.run(_FACTORISE)

    def __del__(self, exits: Callable[[], bool] = sys.is_finalizing) -> None:
        # At interpreter exit the memory goes anyway, and the library may be gone first, as may the
        # names of this module.
        if not exits():
            self.run(_RELEASE)


class _MklCondensation:
    """A `Condensation` by MKL: the kept unknowns are not eliminated.

    Args:
        handle: of the matrix, factorised with these unknowns kept.
        matrix: (m, m) Schur complement.
    """

    def __init__(self, handle: _Handle, matrix: FloatArray) -> None:
        self._handle, self._generation = handle, handle.generation
        self.matrix = np.asarray(matrix, dtype=float)

    @property
    def stored(self) -> bool:
        """Whether the factor is still stored."""
        return self._handle.generation == self._generation

    def eliminate(self, right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Eliminate; see `Condensation`."""
        partial = self._handle.run(_FORWARD, right)
        return np.asarray(partial[self._handle.kept], dtype=float), partial

    def substitute(self, partial: FloatArray, values: FloatArray) -> FloatArray:
        """Substitute back; see `Condensation`."""
        whole = partial.copy()
        whole[self._handle.kept] = values
        return np.asarray(self._handle.run(_BACKWARD, whole), dtype=float)


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

    def __init__(self, pattern: sp.csr_matrix, single: bool = False) -> None:
        self._matrix, self._single = pattern, single
        self.generation, self._current = 0, False
        _pardiso()  # where it is missing, that is said here and now
        self._whole: _Handle | None = None
        self._condensing: dict[bytes, _Handle] = {}

    def factorise(self, data: FloatArray) -> None:
        """Factorise the matrix with these entries of its upper triangle; raises
        NotPositiveDefinite.

        An existing factor of exactly these entries is kept.
        """
        if self._current and np.array_equal(data, self._matrix.data):
            return
        self.generation += 1
        self._current = False
        if self._whole is None:
            self._whole = _Handle(self._matrix, self._single)
        self._matrix.data[:] = data
        self._whole.factorise(data)
        self._current = True

    def condense(self, data: FloatArray, unknowns: IntArray) -> Condensation:
        """Condense the matrix with these entries; see `Factor`.

        The analysis, which depends on the unknowns, is stored for the last sets of them.
        """
        if not len(unknowns):
            raise ValueError("there are no unknowns to condense on; name one at least")
        key = np.asarray(unknowns, dtype=np.int64).tobytes()
        handle = self._condensing.pop(key, None) or _Handle(
            self._matrix, self._single, np.asarray(unknowns)
        )
        self._condensing[key] = handle
        if len(self._condensing) > _CONDENSED_SETS:
            del self._condensing[next(iter(self._condensing))]
        if handle.trusted is not False:
            made = _MklCondensation(handle, handle.factorise(data))
            if handle.trusted is None:
                handle.trusted = self._is_correct(made, data, unknowns)
            if handle.trusted:
                return made
        self.factorise(data)
        return SolvedCondensation(self, self._matrix.shape[0], unknowns)

    def _is_correct(self, made: Condensation, data: FloatArray, unknowns: IntArray) -> bool:
        """Whether a condensation has a known solution; checked once after each analysis."""
        upper = sp.csr_matrix(
            (data, self._matrix.indices, self._matrix.indptr), shape=self._matrix.shape
        )
        known = np.cos(np.arange(upper.shape[0], dtype=float))
        right = _times(upper, known)
        reduced, partial = made.eliminate(right)
        left = [
            reduced - made.matrix @ known[unknowns],
            _times(upper, made.substitute(partial, known[unknowns])) - right,
        ]
        most = _CORRECT[np.dtype(np.float32 if self._single else np.float64)]
        correct = max(np.abs(part).max() for part in left) <= most * np.abs(right).max()
        if not correct:
            log.warning(
                "MKL's Schur complements are wrong on this machine: contact is condensed without "
                "them, which takes longer"
            )
        return bool(correct)

    def approximate(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides, to the factor's precision."""
        if self._whole is None:
            raise RuntimeError("nothing has been factorised yet")
        return np.ascontiguousarray(self._whole.run(_SOLVE, right), dtype=float)

    def solve(self, right: FloatArray) -> FloatArray:
        """Solve for one (n,) or several (n, m) right sides with the last factor."""
        solution = self.approximate(right)
        for _ in range(_MOST_ROUNDS if self._single else 0):
            change = self.approximate(right - _times(self._matrix, solution))
            solution += change
            if (np.abs(change).max(axis=0) <= _SETTLED * np.abs(solution).max(axis=0)).all():
                return solution
        return self._in_double(right) if self._single else solution

    def _in_double(self, right: FloatArray) -> FloatArray:
        """Solve in double precision from now on, for matrices too ill-conditioned for single."""
        log.warning(
            "a stiffness matrix is too ill-conditioned for single precision: solving in double "
            "takes about twice as long"
        )
        self._single, self._current, self._whole = False, False, None
        self._condensing.clear()
        self.factorise(self._matrix.data)
        return self.solve(right)


def _times(upper: sp.csr_matrix, vectors: FloatArray) -> FloatArray:
    """Multiply a symmetric matrix, given by its upper triangle, by one (n,) or several (n, m)
    vectors.
    """
    diagonal = upper.data[upper.indptr[:-1]]
    return np.asarray(upper @ vectors + upper.T @ vectors - (diagonal * vectors.T).T)
