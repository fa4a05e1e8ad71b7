"""Stray points that a whole patch is left with: where the tool hides nearly all of it, a few points
past its rim lie on neither.

A depth camera mixes near and far along an outline. Among a patch's many points such a mixture
stands out by itself; where only two or three are seen there is nothing it could stand out from but
the patches around.
"""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.measurement.patch_averages import MaskArray, patch_medians
from palpate.measurement.surface_gaps import Surface

__all__ = ["among_neighbours"]

_FEW, _FEWEST = 0.35, 4
"""With less than this share of the points that the patches of a group usually have [1], or fewer
than so many, a patch is nearly hidden."""
_AROUND = 9e-3
"""Patches this near [m] say where a nearly hidden one should lie."""
_APART = 1e-3
"""So far from its neighbours' median [m] it cannot lie: a model's error is as smooth as the
surface."""
_NEVER = 6e-3
"""The same of a patch that is seen well: a dent at another time or place is a step of some
millimetres, and no more."""


def among_neighbours(gap: FloatArray, patch: IntArray, surface: Surface) -> MaskArray:
    """Which points (m,) with these gaps (m,) [m] to keep: not those of patches (m,) far off all
    around.

    A nearly hidden patch is far off sooner than one that is seen well.
    """
    count = np.bincount(patch, minlength=surface.patches)
    seen = np.flatnonzero(count)
    if not len(seen):
        return np.ones(0, dtype=bool)
    well = count[seen] >= max(_FEW * float(np.median(count[seen])), _FEWEST)
    middle = patch_medians(gap, patch, surface.patches)[seen]
    centres, normals = surface.patch_centres[seen], surface.patch_normals[seen]
    near = (
        (np.linalg.norm(centres[:, None] - centres, axis=2) < _AROUND)
        & (normals @ normals.T > 0.5)
        & well
    )
    np.fill_diagonal(near, False)
    expected = np.array([np.median(middle[around]) if around.any() else 0.0 for around in near])
    far = np.where(well, np.where(near.any(axis=1), _NEVER, np.inf), _APART)
    return ~np.isin(patch, seen[np.abs(middle - expected) > far])
