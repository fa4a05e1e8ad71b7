"""Points at which a material with history stores its state, fixed in the material.

On a grid that never moves they are its quadrature points, and nothing is interpolated. A graded
grid moves with the tool; passing the state from each grid to the next would smear it slightly every
time. So it is stored on a fine even grid of cells: the strain is its mean over a cell, and is
interpolated once between the cells' centres.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import numpy as np

from palpate.fem.history.voxel_points import VoxelPoints
from palpate.fem.mesh_quadrature import element_quadrature
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.box_mesh import BoxMesh, GridSpec
from palpate.mesh.graded_mesh import Grading
from palpate.mesh.grid_axes import even_axis
from palpate.mesh.protocol import Mesh, Meshing
from palpate.mesh.push_meshes import PushMeshSpec
from palpate.setup.setup import Setup

__all__ = [
    "CellPoints",
    "MaterialPoints",
    "QuadraturePoints",
    "material_points",
    "quadrature_tangents",
]

_CELLS_PER_EDGE, _MOST_CELLS = 1.5, 64
"""Cells per finest edge of the grid, and largest number of cells along an axis. Measured after a
poke by 5 mm and release: the dent left was 0.024 mm RMS off a converged one on a quadratic grid of
1.5 mm, both with such cells and with a fixed grid's quadrature points; with cells of twice the
grid's edge 0.044 mm."""


class MaterialPoints(Protocol):
    """Points of a material, and the interpolation between them and a grid."""

    def tangents(self, mesh: Mesh, positions: FloatArray) -> FloatArray:
        """Derivatives (m, 3, 3) of the nodes' positions (n, 3) along x, y, z at the points [1]."""

    def read(self, mesh: Mesh, field: FloatArray) -> FloatArray:
        """Interpolate a field (m, c) of the points at the quadrature points (e, q, c) of a grid."""


def quadrature_tangents(mesh: Mesh, positions: FloatArray) -> FloatArray:
    """Derivatives (e, q, 3, 3) of the positions (n, 3) along x, y, z at the quadrature
    points [1].
    """
    gradients = element_quadrature(mesh).gradients
    return np.asarray(np.swapaxes(gradients, 2, 3) @ positions[mesh.connectivity.elements][:, None])


class QuadraturePoints:
    """The quadrature points of a grid that does not move."""

    def __init__(self, mesh: Mesh) -> None:
        self._mesh = mesh

    def _same(self, mesh: Mesh) -> None:
        if mesh is not self._mesh and not np.array_equal(mesh.nodes, self._mesh.nodes):
            raise MeshError(
                "the history stored at a grid's quadrature points is lost when the grid moves"
            )

    def tangents(self, mesh: Mesh, positions: FloatArray) -> FloatArray:
        """See `MaterialPoints`."""
        self._same(mesh)
        return quadrature_tangents(mesh, positions).reshape(-1, 3, 3)

    def read(self, mesh: Mesh, field: FloatArray) -> FloatArray:
        """See `MaterialPoints`."""
        self._same(mesh)
        return field.reshape(*element_quadrature(mesh).weights.shape, -1)


class CellPoints:
    """The cells of a fine even grid, independent of the grids on which the block is solved.

    Args:
        size: edge lengths of the block [m].
        cells: number along x, y, z.
    """

    def __init__(self, size: tuple[float, float, float], cells: tuple[int, int, int]) -> None:
        (x, y, z), (nx, ny, nz) = size, cells
        spans = ((-x / 2, x / 2, nx), (-y / 2, y / 2, ny), (0.0, z, nz))
        self._corners = tuple(even_axis(low, high, count + 1) for low, high, count in spans)

    def tangents(self, mesh: Mesh, positions: FloatArray) -> FloatArray:
        """See `MaterialPoints`: means over the cells of the field between their corners."""
        assert isinstance(mesh, BoxMesh)
        nx, ny, nz = mesh.shape
        (mx, dx), (my, dy), (mz, dz) = (_means(self, mesh, axis) for axis in range(3))
        field = positions.reshape(nz, ny, nx, 3)
        # The axis with the shortest rows behind it comes first, while the field is small.
        mean, rising = _along(mx, field, 2), _along(dx, field, 2)
        result = np.empty((np.prod(self._counts), 3, 3))
        result[:, 0] = _along(mz, _along(my, rising, 1), 0).reshape(-1, 3)
        result[:, 1] = _along(mz, _along(dy, mean, 1), 0).reshape(-1, 3)
        result[:, 2] = _along(dz, _along(my, mean, 1), 0).reshape(-1, 3)
        return result

    def read(self, mesh: Mesh, field: FloatArray) -> FloatArray:
        """See `MaterialPoints`."""
        assert isinstance(mesh, BoxMesh)
        result = field.reshape(*self._counts[::-1], -1)
        for axis in (2, 1, 0):
            result = _along(_reading(self, mesh, axis), result, 2 - axis)
        (ex, ey, ez), points = _elements(mesh), _points_along(mesh)
        result = result.reshape(ez, points, ey, points, ex, points, -1).transpose(
            0, 2, 4, 1, 3, 5, 6
        )
        return np.ascontiguousarray(result).reshape(ez * ey * ex, points**3, -1)

    @property
    def _counts(self) -> list[int]:
        """Number of cells along x, y, z."""
        return [len(corners) - 1 for corners in self._corners]


def _along(matrix: FloatArray, field: FloatArray, axis: int) -> FloatArray:
    """Apply a matrix (p, n) to one axis of n of a field."""
    before, after = field.shape[:axis], field.shape[axis + 1 :]
    rows = field.reshape(int(np.prod(before)), field.shape[axis], int(np.prod(after)))
    return np.asarray(np.matmul(matrix, rows).reshape(*before, len(matrix), *after))


def _elements(mesh: BoxMesh) -> tuple[int, int, int]:
    nx, ny, nz = ((count - 1) // mesh.order for count in mesh.shape)
    return nx, ny, nz


def _points_along(mesh: BoxMesh) -> int:
    """Number of quadrature points of an element along one edge."""
    return round(float(np.cbrt(element_quadrature(mesh).weights.shape[1])))


@lru_cache(maxsize=96)
def _means(cells: CellPoints, mesh: BoxMesh, axis: int) -> tuple[FloatArray, FloatArray]:
    """Mean value (c, n) and mean slope (c, n) [1/m] over the cells along an axis.

    The matrices apply to values at the grid's nodes.
    """
    corners = cells._corners[axis]
    at_corners = mesh.shapes_along(axis, corners)
    return (at_corners[1:] + at_corners[:-1]) / 2, np.diff(at_corners, axis=0) / (
        corners[1] - corners[0]
    )


@lru_cache(maxsize=96)
def _reading(cells: CellPoints, mesh: BoxMesh, axis: int) -> FloatArray:
    """Linear interpolation (p, c) from the cells' centres to the grid's quadrature points, along an
    axis.
    """
    corners, points = cells._corners[axis], _points_along(mesh)
    middles = (corners[1:] + corners[:-1]) / 2
    apart = element_quadrature(mesh).places.reshape(*_elements(mesh)[::-1], *([points] * 3), 3)
    places = np.moveaxis(apart[..., axis], (2 - axis, 5 - axis), (0, 1))[:, :, 0, 0, 0, 0].ravel()
    result = np.zeros((len(places), len(middles)))
    index = np.clip(np.searchsorted(middles, places) - 1, 0, len(middles) - 2)
    share = (places - middles[index]) / (middles[1] - middles[0])
    rows = np.arange(len(places))
    result[rows, index], result[rows, index + 1] = 1 - share, share
    return result


def material_points(setup: Setup, grid: Meshing, mesh: Mesh) -> MaterialPoints:
    """The points for a body with this mesh specification, of which `mesh` is one."""
    if isinstance(grid, PushMeshSpec) and len(grid.places) > 1:
        return VoxelPoints(setup, grid.spacing)
    spacing = grid.spacing if isinstance(grid, Grading | GridSpec) else None
    if spacing is None:
        return QuadraturePoints(mesh)
    size = setup.geometry.size
    nx, ny, nz = (
        int(np.clip(np.ceil(_CELLS_PER_EDGE * edge / spacing), 2, _MOST_CELLS)) for edge in size
    )
    return CellPoints(size, (nx, ny, nz))
