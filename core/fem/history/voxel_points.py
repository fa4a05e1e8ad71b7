"""Points at which a free form's material stores its state, independent of its meshes.

Each push has a mesh of its own; the state is stored at the middles of even voxels, as that of a
block is (`palpate.fem.history.material_points`).
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product

import numpy as np
from scipy.sparse import csr_array
from scipy.spatial import cKDTree

from palpate.fem.mesh_quadrature import element_quadrature
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.protocol import Mesh
from palpate.mesh.tet_mesh import TetMesh
from palpate.setup.setup import Setup

__all__ = ["VoxelPoints"]

_VOXELS_PER_EDGE, _MOST_VOXELS = 1.5, 64
"""Voxels per finest edge of a mesh, and largest number of voxels along an axis, as for blocks."""


class VoxelPoints:
    """The middles of the voxels inside a free form.

    Args:
        setup: with the body.
        spacing: of a mesh's nodes where it is finest [m].
    """

    def __init__(self, setup: Setup, spacing: float) -> None:
        stated = setup.stated_geometry
        edge = max(spacing / _VOXELS_PER_EDGE, max(stated.size) / _MOST_VOXELS)
        counts = np.maximum(np.ceil(np.array(stated.size) / edge).astype(int), 2)
        steps = [np.arange(count) for count in counts]
        numbers = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 3)
        middles = stated.low + (numbers + 0.5) * edge
        inside = stated.outside(middles) < 0
        self._low, self._edge = stated.low * setup.scale, edge * setup.scale
        self._middles = middles[inside] * setup.scale
        # Number of each voxel's point; -1 outside. One voxel more at each side is outside.
        self._index = np.full(counts + 2, -1)
        self._index[tuple((numbers[inside] + 1).T)] = np.arange(int(inside.sum()))

    def tangents(self, mesh: Mesh, positions: FloatArray) -> FloatArray:
        """See `MaterialPoints`."""
        nodes, slopes = _slopes(self, mesh)
        return np.asarray(slopes.transpose(0, 2, 1) @ positions[nodes])

    def read(self, mesh: Mesh, field: FloatArray) -> FloatArray:
        """See `MaterialPoints`."""
        return np.asarray(_reading_of(self, mesh) @ field).reshape(
            *element_quadrature(mesh).weights.shape, -1
        )


@lru_cache(maxsize=32)
def _slopes(points: VoxelPoints, mesh: Mesh) -> tuple[IntArray, FloatArray]:
    assert isinstance(mesh, TetMesh)
    return mesh.slopes(points._middles)


@lru_cache(maxsize=32)
def _reading_of(points: VoxelPoints, mesh: Mesh) -> csr_array:
    """Linear interpolation (p, v) from the voxels inside to a mesh's quadrature points.

    A quadrature point without a voxel inside around it takes the value of the nearest one.
    """
    places = element_quadrature(mesh).places.reshape(-1, 3)
    at = (places - points._low) / points._edge + 0.5
    first = np.clip(np.floor(at).astype(int), 0, np.array(points._index.shape) - 2)
    part = np.clip(at - first, 0.0, 1.0)
    rows, columns, shares = list[IntArray](), list[IntArray](), list[FloatArray]()
    for corner in product((0, 1), repeat=3):
        number = points._index[tuple((first + corner).T)]
        share = np.where(np.array(corner) == 1, part, 1 - part).prod(axis=1)
        used = np.flatnonzero((number >= 0) & (share > 0))
        rows.append(used)
        columns.append(number[used])
        shares.append(share[used])
    row, value = np.concatenate(rows), np.concatenate(shares)
    total = np.bincount(row, value, minlength=len(places))
    alone = np.flatnonzero(total == 0)
    near = cKDTree(points._middles).query(places[alone])[1]
    row = np.concatenate([row, alone])
    value = np.concatenate([value / total[row[: len(value)]], np.ones(len(alone))])
    column = np.concatenate([*columns, near])
    return csr_array((value, (row, column)), shape=(len(places), len(points._middles)))
