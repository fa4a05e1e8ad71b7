"""Array types, and the norm of many vectors."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["BoolArray", "FloatArray", "IntArray", "lengths"]

BoolArray = np.ndarray[Any, np.dtype[np.bool_]]
FloatArray = np.ndarray[Any, np.dtype[np.float64]]
IntArray = np.ndarray[Any, np.dtype[np.integer[Any]]]


def lengths(vectors: FloatArray) -> FloatArray:
    """Compute the Euclidean norms (n,) of vectors (n, 3).

    2.5 times as fast as `np.linalg.norm`, with the same result to the last digit.
    """
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z))
