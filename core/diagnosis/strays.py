"""Stray points that a whole patch is left with: where the tool hides nearly all of it, a few points past its rim lie on neither.

A depth camera mixes near and far along an outline. Among a patch's many points such a mixture stands out by itself; where only
two or three are seen there is nothing it could stand out from but the patches around.
"""

from __future__ import annotations

import numpy as np

from core.frames import FloatArray
from core.measurement import MaskArray, Surface
from core.mesh import IntArray

__all__ = ["among_neighbours"]

_FEW, _FEWEST = 0.35, 4
"""With less than this share of the points that the patches of a group usually have [1], or fewer than so many, a patch is nearly
hidden."""
_AROUND = 9e-3
"""Patches this near [m] say where a nearly hidden one should lie."""
_APART = 1e-3
"""So far from its neighbours' median [m] it cannot lie: a model's error is as smooth as the surface."""


def among_neighbours(gap: FloatArray, patch: IntArray, surface: Surface) -> MaskArray:
    """Which points (m,) with these gaps (m,) [m] to keep: not those of nearly hidden patches (m,) far off all around."""
    count = np.bincount(patch, minlength=surface.patches)
    seen = np.flatnonzero(count)
    if not len(seen):
        return np.ones(0, dtype=bool)
    few = seen[count[seen] < max(_FEW * float(np.median(count[seen])), _FEWEST)]
    well = np.setdiff1d(seen, few)
    centres, normals = surface.patch_centres, surface.patch_normals
    middle = {number: float(np.median(gap[patch == number])) for number in few}
    lost = []
    for number, value in middle.items():
        near = np.linalg.norm(centres[well] - centres[number], axis=1) < _AROUND
        around = well[near & (normals[well] @ normals[number] > 0.5)]
        expected = np.median([np.median(gap[patch == other]) for other in around]) if len(around) else 0.0
        if abs(value - expected) > _APART:
            lost.append(number)
    return ~np.isin(patch, lost)
