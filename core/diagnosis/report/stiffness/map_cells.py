"""Cells of a body in which its stiffness may differ, near the places that a tool touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import KDTree

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Inclusion

__all__ = ["MapCells", "cells_near"]


@dataclass(frozen=True, eq=False)
class MapCells:
    """Cells of a lattice that tiles the bounds of a body.

    Attributes:
        centres: (m, 3) within the body [m].
        edges: (3,) of a cell [m].
    """

    centres: FloatArray
    edges: FloatArray

    @property
    def spacing(self) -> float:
        """Edge of a cube of a cell's volume [m]."""
        return float(np.prod(self.edges) ** (1 / 3))

    @property
    def balls(self) -> tuple[Inclusion, ...]:
        """A ball of the volume of each cell, by which its stiffness is varied.

        Together they fill the body as the cells do.
        """
        radius = self.spacing * (3 / (4 * np.pi)) ** (1 / 3)
        return tuple(
            Inclusion(x=x, y=y, z=z, radius=radius, stiffness_ratio=1.0)
            for x, y, z in self.centres.tolist()
        )


def cells_near(contacts: FloatArray, body: Geometry, radius: float) -> MapCells:
    """Return the cells whose stiffness a push may feel.

    The cells are as small as the tool can tell apart, and larger where they would be too many.

    Args:
        contacts: places (k, 3) of the surface that the tool touches [m].
        body: the phantom.
        radius: of the tool [m].
    """
    touched, edge = KDTree(contacts), CRITERIA.stiffness_map.cell * radius
    reach = CRITERIA.stiffness_map.reach * radius
    while True:
        size = body.high - body.low
        counts = np.maximum(np.round(size / edge), 1).astype(int)
        axes = [
            low + (np.arange(count) + 0.5) * length / count
            for low, length, count in zip(body.low, size, counts, strict=True)
        ]
        centres = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
        centres = centres[touched.query(centres)[0] < reach]
        if len(centres):
            centres = centres[body.outside(centres) < 0]
        if len(centres) <= CRITERIA.stiffness_map.most_cells:
            return MapCells(centres, size / counts)
        edge *= CRITERIA.stiffness_map.growth
