"""Series thinned for display: the extremes of each part are kept."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["as_list", "extreme_rows"]

Rows = np.ndarray[Any, np.dtype[np.int64]]


def extreme_rows(values: FloatArray, most: int) -> Rows:
    """Rows of a series in which it is least or largest within even parts, with both ends.

    Args:
        values: (n, k) columns, each of whose extremes are kept.
        most: number of rows.

    Returns:
        (m,) increasing, at most `most`; all rows where there are no more.
    """
    count, columns = values.shape
    if count <= most:
        return np.arange(count)
    parts = max(1, (most - 2) // (2 * columns))
    edges = np.linspace(0, count, parts + 1).astype(int)
    rows = [0, count - 1]
    for start, end in pairwise(edges.tolist()):
        part = values[start:end]
        rows += (start + part.argmin(axis=0)).tolist() + (start + part.argmax(axis=0)).tolist()
    return np.unique(np.array(rows, dtype=np.int64))


def as_list(values: FloatArray, digits: int = 6) -> list[float]:
    """Numbers (n,) as JSON has them, rounded."""
    return [float(value) for value in np.round(values, digits).tolist()]
