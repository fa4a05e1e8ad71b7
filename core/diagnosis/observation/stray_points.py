"""Stray points that a whole patch is left with: where the tool hides nearly all of it, a few points
past its rim lie on neither.

A depth camera mixes near and far along an outline. Among a patch's many points such a mixture
stands out by itself; where only two or three are seen there is nothing it could stand out from but
the patches around.
"""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.measurement.patch_averages import MaskArray, patch_medians
from palpate.measurement.surface_gaps import Surface

__all__ = ["agrees_with_neighbours"]


def agrees_with_neighbours(gap: FloatArray, patch: IntArray, surface: Surface) -> MaskArray:
    """Which points (m,) with these gaps (m,) [m] to keep: not those of patches (m,) far off all
    around.

    A nearly hidden patch is far off sooner than one that is seen well.
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
    near = (
        (np.linalg.norm(centres[:, None] - centres, axis=2) < CRITERIA.outliers.neighbour_distance)
        & (normals @ normals.T > CRITERIA.outliers.same_side_cosine)
        & well
    )
    np.fill_diagonal(near, False)
    expected = np.array([np.median(middle[around]) if around.any() else 0.0 for around in near])
    far = np.where(
        well,
        np.where(near.any(axis=1), CRITERIA.outliers.seen_offset, np.inf),
        CRITERIA.outliers.hidden_offset,
    )
    return ~np.isin(patch, seen[np.abs(middle - expected) > far])
