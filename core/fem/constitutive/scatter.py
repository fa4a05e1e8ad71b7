"""Addition of element matrices to a sparse matrix."""

from __future__ import annotations

from typing import Any

from numba import njit

__all__ = ["scatter"]


@njit(cache=True)
def scatter(matrix: Any, slots: Any, data: Any) -> None:
    """Add an element's matrix, of which the upper blocks are given, to `data`."""
    for row in range(matrix.shape[0]):
        for column in range(3 * (row // 3), matrix.shape[0]):
            slot = slots[row, column]
            if slot >= 0:
                data[slot] += matrix[row, column]
            if column // 3 != row // 3:
                slot = slots[column, row]
                if slot >= 0:
                    data[slot] += matrix[row, column]
