"""Size of hidden effects on the surface that a camera sees."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["mean_square_change", "visible_weights"]


def visible_weights(
    rest: FloatArray, faces: Any, size: tuple[float, float, float], seen: FloatArray
) -> FloatArray:
    """Area (s,) [m^2] of each drawn point on the top or on one of the two `seen` sides; zero
    elsewhere.
    """
    edges = rest[faces[:, 1:]] - rest[faces[:, :1]]
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = 0.5 * np.linalg.norm(normals, axis=1)
    middle = rest[faces].mean(axis=1)
    shown = middle[:, 2] > size[2] - 1e-6
    for axis in range(2):
        shown |= seen[axis] * middle[:, axis] > size[axis] / 2 - 1e-6
    area = np.bincount(
        faces.ravel(), weights=np.repeat(np.where(shown, areas / 3, 0.0), 3), minlength=len(rest)
    )
    return np.asarray(area, dtype=float)


def mean_square_change(
    rest: FloatArray,
    true: FloatArray,
    believed: FloatArray,
    camera_shift: Transform,
    weights: FloatArray,
) -> float:
    """Mean square over the visible surface of true minus believed displacement (s, 3), as a
    believed camera sees it [m^2].
    """
    seen = camera_shift.inverse().apply(rest + true)
    return float(np.sum(weights * np.sum((seen - rest - believed) ** 2, axis=1)) / np.sum(weights))
