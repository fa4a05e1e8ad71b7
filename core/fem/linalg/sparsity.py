"""Patterns of sparse symmetric systems, and the choice of a direct solver."""

from __future__ import annotations

import logging
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from numba import njit

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
    nodes, count = len(unknown), int(unknown.max()) + 1
    rows = np.repeat(elements, elements.shape[1], axis=1).ravel()
    columns = np.tile(elements, (1, elements.shape[1])).ravel()
    ones = np.ones(len(rows), dtype=np.int8)
    neighbours = sp.csr_matrix((ones, (rows, columns)), shape=(nodes, nodes))
    starts, indices = _upper_rows(neighbours.indptr, neighbours.indices, unknown, count)
    pattern = sp.csr_matrix((np.zeros(len(indices)), indices, starts), shape=(count, count))
    return pattern, face_slots(pattern, elements, unknown)


def face_slots(pattern: sp.csr_matrix, faces: IntArray, unknown: IntArray) -> IntArray:
    """Slots as of `upper_pattern`, for faces (f, a) whose nodes share an element."""
    numbers = unknown[faces].reshape(len(faces), -1)
    slots: IntArray = _find(numbers, pattern.indptr, pattern.indices)
    return slots


@njit(cache=True)
def _upper_rows(starts: Any, neighbours: Any, unknown: Any, count: int) -> Any:
    """Row starts and sorted columns of the upper triangle of the unknowns' pattern.

    Args:
        starts: (n + 1,) of each node's neighbours.
        neighbours: nodes that share an element, the node itself among them.
        unknown: (n, 3) as of `upper_pattern`.
        count: of the unknowns.
    """
    lengths = np.zeros(count + 1, dtype=np.int32)
    indices = np.empty(9 * len(neighbours), dtype=np.int32)
    node_of = np.empty(count, dtype=np.int64)
    for node in range(unknown.shape[0]):
        for axis in range(unknown.shape[1]):
            if unknown[node, axis] >= 0:
                node_of[unknown[node, axis]] = node
    filled = 0
    for row in range(count):
        begin = filled
        for place in range(starts[node_of[row]], starts[node_of[row] + 1]):
            for axis in range(unknown.shape[1]):
                column = unknown[neighbours[place], axis]
                if column >= row:
                    indices[filled] = column
                    filled += 1
        indices[begin:filled].sort()
        lengths[row + 1] = filled
    return lengths, indices[:filled].copy()


@njit(cache=True)
def _find(numbers: Any, starts: Any, indices: Any) -> Any:
    """Slots (f, m, m) between the unknowns (f, m) of each face, see `upper_pattern`."""
    slots = np.full((numbers.shape[0], numbers.shape[1], numbers.shape[1]), -1, dtype=np.int32)
    for f in range(numbers.shape[0]):
        for i in range(numbers.shape[1]):
            row = numbers[f, i]
            if row < 0:
                continue
            columns = indices[starts[row] : starts[row + 1]]
            for j in range(numbers.shape[1]):
                if numbers[f, j] >= row:
                    slots[f, i, j] = starts[row] + np.searchsorted(columns, numbers[f, j])
    return slots
