"""The true form of a block's drawn surface, fine enough for rounded edges."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy import sparse

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances.nuisance import Nuisance
from palpate.synthetic.nuisances.nuisance_chain import formed

__all__ = ["FormedSurface"]

_FINE, _MARGIN, _MOST_SPLITS = 0.8e-3, 5e-3, 6
"""Longest edge near the block's edges [m], their neighbourhood [m], and number of splits."""


class FormedSurface:
    """A drawn surface whose form the nuisances change.

    Attributes:
        rest: (m, 3) places on the stated block [m].
        faces: (t, 3) triangles.
    """

    def __init__(
        self,
        rest: FloatArray,
        faces: Any,
        size: tuple[float, float, float],
        nuisances: Sequence[Nuisance],
    ) -> None:
        self._weights = sparse.identity(len(rest), format="csr")
        self.rest, self.faces = rest, np.asarray(faces)
        if any(type(one).form is not Nuisance.form for one in nuisances):
            self._refine(rest, size)
        self._offset = formed(nuisances, self.rest, size) - self.rest

    def displaced(self, displacement: FloatArray) -> FloatArray:
        """Vertices (m, 3) [m] for a displacement (s, 3) [m] of the drawn surface."""
        return np.asarray(self.rest + self._offset + self._weights @ displacement)

    def _refine(self, rest: FloatArray, size: tuple[float, float, float]) -> None:
        """Split triangles near the block's edges until they are short."""
        for _ in range(_MOST_SPLITS):
            corners = self.rest[self.faces]
            lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
            chosen = (lengths.max(axis=1) > _FINE) & _near_edge(corners, size)
            if not chosen.any():
                return
            self._split(chosen)
            self.rest = np.asarray(self._weights @ rest)

    def _split(self, chosen: Any) -> None:
        """Split each chosen triangle into four at the middles of its sides."""
        faces = self.faces[chosen]
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
        unique, inverse = np.unique(sides, axis=0, return_inverse=True)
        middles = (inverse.reshape(-1, 3) + self._weights.shape[0]).T
        added = 0.5 * (self._weights[unique[:, 0]] + self._weights[unique[:, 1]])
        self._weights = sparse.vstack([self._weights, added], format="csr")
        a, b, c = faces.T
        ab, bc, ca = middles
        parts = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
        new = np.concatenate([np.stack(part, axis=1) for part in parts])
        self.faces = np.concatenate([self.faces[~chosen], new])


def _near_edge(corners: FloatArray, size: tuple[float, float, float]) -> Any:
    """Mask (t,) of triangles (t, 3, 3) [m] that come near two sides, or near a side and the top."""
    x, y, z = np.moveaxis(np.abs(corners), 2, 0)
    near = [half - along < _MARGIN for half, along in ((size[0] / 2, x), (size[1] / 2, y))]
    near.append(size[2] - z < _MARGIN)
    close = np.array([one.any(axis=1) for one in near])
    return close.sum(axis=0) >= 2
