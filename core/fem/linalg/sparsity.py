"""Patterns of sparse symmetric systems, and the choice of a direct solver."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import lru_cache

import numpy as np
import scipy.sparse as sp

from palpate.fem.linalg.direct_solver import Factor
from palpate.fem.linalg.superlu import SuperLUFactor
from palpate.foundation.arrays import IntArray

__all__ = ["SOLVERS", "face_slots", "factor_of", "upper_pattern"]

log = logging.getLogger(__name__)


def _pardiso(pattern: sp.csr_matrix, single: bool = False) -> Factor:
    from palpate.fem.linalg.pardiso import Pardiso

    return Pardiso(pattern, single)


def _superlu(pattern: sp.csr_matrix, single: bool = False) -> Factor:
    return SuperLUFactor(pattern)


SOLVERS: dict[str, Callable[..., Factor]] = {"pardiso": _pardiso, "superlu": _superlu}
"""Solvers by name, fastest first."""


@lru_cache(maxsize=1)
def _best() -> str:
    """Name of the first solver that works on this machine; a slow one is logged."""
    trial = sp.csr_matrix(sp.eye(2))
    for name, make in SOLVERS.items():
        try:
            make(trial)
        except ImportError as error:
            log.warning(
                "no %s on this machine (%s): solving takes several times as long", name, error
            )
            continue
        return name
    raise RuntimeError("no sparse direct solver works on this machine")


def factor_of(pattern: sp.csr_matrix, solver: str | None = None, *, single: bool = False) -> Factor:
    """Make a solver for matrices with this pattern.

    Args:
        pattern: upper triangle and diagonal in CSR form, indices sorted.
        solver: name; the best by default.
        single: single precision if the solver has it, in half the time: for Newton steps and other
            intermediate results.
    """
    return SOLVERS[solver or _best()](pattern, single)


def upper_pattern(elements: IntArray, unknown: IntArray) -> tuple[sp.csr_matrix, IntArray]:
    """Pattern of the stiffness matrix of the unknowns, and the index of each element's entries in
    its data.

    Args:
        elements: (e, a) nodes.
        unknown: (n, 3) number of the unknown of each node and axis; -1 where the displacement is
            given.

    Returns:
        upper triangle in CSR form; (e, 3a, 3a) slots, -1 below the diagonal and for given
            displacements.
    """
    numbers = unknown[elements].reshape(len(elements), -1)
    rows = np.repeat(numbers, numbers.shape[1], axis=1).ravel()
    columns = np.tile(numbers, (1, numbers.shape[1])).ravel()
    used = (rows >= 0) & (columns >= rows)
    count = int(unknown.max()) + 1
    keys, inverse = np.unique(
        rows[used].astype(np.int64) * count + columns[used], return_inverse=True
    )
    slots = np.full(len(rows), -1, dtype=np.int32)
    slots[used] = inverse
    indptr = np.searchsorted(keys // count, np.arange(count + 1))
    pattern = sp.csr_matrix((np.zeros(len(keys)), keys % count, indptr), shape=(count, count))
    return pattern, slots.reshape(len(elements), numbers.shape[1], numbers.shape[1])


def face_slots(pattern: sp.csr_matrix, faces: IntArray, unknown: IntArray) -> IntArray:
    """Slots as of `upper_pattern`, for faces (f, a) whose nodes share an element."""
    numbers = unknown[faces].reshape(len(faces), -1)
    rows = np.repeat(numbers, numbers.shape[1], axis=1).ravel()
    columns = np.tile(numbers, (1, numbers.shape[1])).ravel()
    used = (rows >= 0) & (columns >= rows)
    count = pattern.shape[0]
    keys = (
        np.repeat(np.arange(count, dtype=np.int64), np.diff(pattern.indptr)) * count
        + pattern.indices
    )
    slots = np.full(len(rows), -1, dtype=np.int32)
    slots[used] = np.searchsorted(keys, rows[used].astype(np.int64) * count + columns[used])
    return slots.reshape(len(faces), numbers.shape[1], numbers.shape[1])
