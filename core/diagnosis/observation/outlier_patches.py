"""Outlier patches: patches whose points disagree with the patches around.

A depth camera mixes near and far surfaces along an outline. Among the many points of a well-covered
patch such a mixture is an outlier by itself. A patch that the tool nearly hides has too few points
for that, and is compared with its neighbours.
"""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.measurement.patch_averages import MaskArray, patch_medians
from palpate.setup.phantom_geometry import Surface

__all__ = ["agrees_with_neighbours", "neighbours"]


def agrees_with_neighbours(gap: FloatArray, patch: IntArray, surface: Surface) -> MaskArray:
    """Mask (m,) of the points whose patch lies near its neighbours.

    A nearly hidden patch must lie nearer to them than a well-covered one.

    Args:
        gap: (m,) of the points [m].
        patch: (m,) number of each point's patch.
        surface: with the patches.
    """
    count = np.bincount(patch, minlength=surface.patches)
    seen = np.flatnonzero(count)
    if not len(seen):
        return np.ones(0, dtype=bool)
    well = count[seen] >= max(
        CRITERIA.outliers.hidden_share * float(np.median(count[seen])),
        CRITERIA.outliers.hidden_points,
    )
    middle = patch_medians(gap, patch, surface.patches)[seen]
    centres, normals = surface.patch_centres[seen], surface.patch_normals[seen]
    expected = _medians(middle, near := neighbours(centres, normals) & well)
    far = np.where(
        well,
        np.where(near.any(axis=1), CRITERIA.outliers.seen_offset, np.inf),
        CRITERIA.outliers.hidden_offset,
    )
    return ~np.isin(patch, seen[np.abs(middle - expected) > far])


def neighbours(centres: FloatArray, normals: FloatArray) -> MaskArray:
    """Mask (p, p) of the patches that are near each other on one side of the surface.

    Args:
        centres: of the patches (p, 3) [m].
        normals: of the patches (p, 3).
    """
    near = np.linalg.norm(centres[:, None] - centres, axis=2) < CRITERIA.outliers.neighbour_distance
    near &= normals @ normals.T > CRITERIA.outliers.same_side_cosine
    np.fill_diagonal(near, False)
    return np.asarray(near)


def _medians(values: FloatArray, near: MaskArray) -> FloatArray:
    """Median (s,) of the values (s,) that each row of a mask (s, s) chooses; zero without any.

    All rows at once: a median of its own for each row takes ten times as long.
    """
    ordered = np.sort(np.where(near, values, np.inf), axis=1)
    count, rows = near.sum(axis=1), np.arange(len(near))
    low, high = ordered[rows, np.maximum(count - 1, 0) // 2], ordered[rows, count // 2 % len(near)]
    return np.where(count > 0, 0.5 * (low + high), 0.0)
