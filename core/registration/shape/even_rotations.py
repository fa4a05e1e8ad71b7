"""Evenly spread rotations, for searches over all of them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray

__all__ = ["even_rotations"]


def even_rotations(count: int) -> FloatArray:
    """Return rotations (count, 3, 3): super-Fibonacci spirals (Alexa 2022)."""
    golden, psi = np.sqrt(2.0), 1.533751168755204288118041
    step = np.arange(count) + 0.5
    alpha, beta = 2 * np.pi * step / golden, 2 * np.pi * step / psi
    low, high = np.sqrt(step / count), np.sqrt(1 - step / count)
    quaternions = np.stack(
        [low * np.sin(alpha), low * np.cos(alpha), high * np.sin(beta), high * np.cos(beta)], axis=1
    )
    return np.asarray(Rotation.from_quat(quaternions).as_matrix())
