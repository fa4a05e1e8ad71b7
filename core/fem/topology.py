"""Unknowns and matrix pattern of a mesh's connectivity."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from palpate.fem.linalg.sparsity import face_slots, factor_of, upper_pattern
from palpate.mesh.protocol import Connectivity

__all__ = ["Topology", "topology"]


class Topology:
    """Unknowns, matrix pattern and symbolic factorisation, shared by meshes of one connectivity."""

    def __init__(self, connectivity: Connectivity, held: bool) -> None:
        self.element = connectivity.element
        self.elements = connectivity.elements
        self.surface, self.base, self.hull = (
            connectivity.surface,
            connectivity.base,
            connectivity.hull,
        )
        free = np.ones((connectivity.count, 3), dtype=bool)
        if held:
            free[connectivity.base_nodes] = False
        self.free = free
        self.unknown = np.where(free, np.cumsum(free).reshape(free.shape) - 1, -1)
        pattern, self.slots = upper_pattern(self.elements, self.unknown)
        self.surface_slots = face_slots(pattern, self.surface, self.unknown)
        self.base_slots = face_slots(pattern, self.base, self.unknown)
        self.pattern = pattern
        rows = np.repeat(np.arange(pattern.shape[0]), np.diff(pattern.indptr))
        self.diagonal = np.flatnonzero(rows == pattern.indices)
        self.factor = factor_of(pattern, single=True)


@lru_cache(maxsize=5)
def topology(connectivity: Connectivity, held: bool) -> Topology:
    """The topology of a connectivity; `held` removes the base nodes from the unknowns."""
    return Topology(connectivity, held)
