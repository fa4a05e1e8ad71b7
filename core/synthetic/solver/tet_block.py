"""The block as quadratic tetrahedra, graded towards the contact, by scikit-fem."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError

__all__ = [
    "Sampling",
    "TetBlock",
    "TetGrading",
    "mesh_block",
    "refine_mesh",
    "shape_values",
    "tet_block_from_mesh",
]

IntArray = np.ndarray[Any, np.dtype[np.int64]]
SEAM = 2.5e-3
"""Longest edge at a seam [m]."""
_PAIRS = [(a, b) for a in range(4) for b in range(a)]


@dataclass(frozen=True)
class TetGrading:
    """Longest edges of elements: at most `fine + growth * distance` from each of `points`.

    Attributes:
        points: (n, 3) where the mesh is fine, phantom frame [m].
        reach: (n,) distance from each point up to which `fine` holds [m].
        fine: (n,) longest edge there [m].
        coarse: longest edge anywhere [m].
        growth: longest edge per distance [1].
        levels: heights between two materials, which no element crosses [m].
        seams: axis (0 or 1) and position [m] of lines on the base that no element crosses, with
            edges of at most `SEAM` there.
    """

    points: FloatArray
    reach: FloatArray
    fine: FloatArray
    coarse: float = 12e-3
    growth: float = 0.6
    levels: tuple[float, ...] = ()
    seams: tuple[tuple[int, float], ...] = ()

    def allowed(self, places: FloatArray) -> FloatArray:
        """The longest edge (n,) [m] allowed at `places` (n, 3)."""
        edge = np.full(len(places), np.inf)
        for point, reach, fine in zip(self.points, self.reach, self.fine, strict=True):
            distance = np.maximum(np.linalg.norm(places - point, axis=1) - reach, 0.0)
            edge = np.minimum(edge, fine + self.growth * distance)
        for axis, place in self.seams:
            edge = np.minimum(
                edge, SEAM + self.growth * np.hypot(places[:, axis] - place, places[:, 2])
            )
        return edge


@dataclass(frozen=True)
class Sampling:
    """Quadrature points on the surface.

    Attributes:
        owner: (f,) element of each facet.
        values: (f, q, 10) shape functions of the owner at the points.
        weights: (f, q) [m^2].
    """

    owner: IntArray
    values: FloatArray
    weights: FloatArray


@dataclass(frozen=True)
class TetBlock:
    """Quadratic tetrahedra of one block, phantom frame.

    Attributes:
        nodes: (n, 3) [m].
        elements: (e, 10).
        gradients: (e, 4, 10, 3) of the shape functions at the volume points [1/m].
        weights: (e, 4) [m^3].
        places: (e, 4, 3) of the volume points [m].
        skin: points of the sides and the top, where the tool acts.
        sole: points of the base, where the table acts.
        surface: (s, n) operator from nodal values to the points of the drawn surface.
        surface_rest: (s, 3) [m].
        surface_normals: (s, 3) outward at rest; points of several faces that coincide have one
            each.
        surface_faces: (t, 3) triangles of the drawn surface, without the base.
        below_skin: (e, 4) depth of the volume points below the surface on which a skin lies [m];
            None for a block, where it is that below the top.
    """

    nodes: FloatArray
    elements: IntArray
    gradients: FloatArray
    weights: FloatArray
    places: FloatArray
    skin: Sampling
    sole: Sampling
    surface: Any
    surface_rest: FloatArray
    surface_normals: FloatArray
    surface_faces: IntArray
    below_skin: FloatArray | None = None


def mesh_block(size: tuple[float, float, float], grading: TetGrading) -> TetBlock:
    """Mesh the block with tetrahedra as small as `grading` demands; MeshError beyond 60 000."""
    logging.getLogger("skfem").setLevel(logging.ERROR)
    return tet_block_from_mesh(_refined(size, grading))


def tet_block_from_mesh(mesh: Any, mapping: Any = None) -> TetBlock:
    """A body that stands on z = 0 from scikit-fem's mesh of its tetrahedra.

    Args:
        mesh: scikit-fem's.
        mapping: scikit-fem's mapping of the elements; its default without it.
    """
    from skfem import Basis, ElementTetP2, FacetBasis

    element = ElementTetP2()
    basis = Basis(mesh, element, intorder=2, mapping=mapping)
    base = mesh.facets_satisfying(lambda x: x[2] < 1e-9, boundaries_only=True)
    skin = np.setdiff1d(mesh.boundary_facets(), base)
    lattice, triangles = _lattice(3)
    drawn = FacetBasis(
        mesh, element, mapping=mapping, facets=skin, quadrature=(lattice, np.ones(lattice.shape[1]))
    )
    nodes = np.ascontiguousarray(basis.doflocs.T)
    elements = np.ascontiguousarray(basis.element_dofs.T).astype(np.int64)
    surface = _operator(drawn, elements, len(nodes))
    offsets = np.arange(len(skin))[:, None, None] * lattice.shape[1]
    return TetBlock(
        nodes=nodes,
        elements=elements,
        gradients=np.ascontiguousarray(
            np.transpose([part[0].grad for part in basis.basis], (2, 3, 0, 1))
        ),
        weights=np.ascontiguousarray(basis.dx),
        places=np.ascontiguousarray(
            np.transpose(np.asarray(basis.global_coordinates()), (1, 2, 0))
        ),
        skin=_sampling(FacetBasis(mesh, element, mapping=mapping, facets=skin, intorder=4)),
        sole=_sampling(FacetBasis(mesh, element, mapping=mapping, facets=base, intorder=4)),
        surface=surface,
        surface_rest=np.asarray(surface @ nodes),
        surface_normals=np.ascontiguousarray(
            np.transpose(np.asarray(drawn.normals), (1, 2, 0))
        ).reshape(-1, 3),
        surface_faces=(triangles[None] + offsets).reshape(-1, 3),
    )


def _refined(size: tuple[float, float, float], grading: TetGrading) -> Any:
    from skfem import MeshTet

    cells = np.maximum(np.ceil(np.array(size) / grading.coarse).astype(int), 2)
    x, y = (
        _cells(length, int(count), [place for own, place in grading.seams if own == axis])
        for axis, (length, count) in enumerate(zip(size[:2], cells[:2], strict=True))
    )
    return refine_mesh(
        MeshTet.init_tensor(x, y, _heights(size[2], int(cells[2]), grading)), grading
    )


def _cells(length: float, count: int, seams: list[float]) -> FloatArray:
    """Boundaries of cells before refinement (k,) [m], symmetric but for the seams."""
    if not seams:
        return np.linspace(0.0, length, count + 1) - length / 2
    ends = [-length / 2, *sorted(seams), length / 2]
    parts = [
        np.linspace(low, high, 1 + int(np.ceil((high - low) * count / length)))
        for low, high in pairwise(ends)
    ]
    return np.unique(np.concatenate(parts))


def refine_mesh(mesh: Any, grading: TetGrading) -> Any:
    """Halve scikit-fem's tetrahedra until they are as small as `grading` demands; MeshError beyond
    60 000.
    """
    for _ in range(40):
        corners = mesh.p[:, mesh.t]
        longest = np.max(
            [np.linalg.norm(corners[:, a] - corners[:, b], axis=0) for a, b in _PAIRS], axis=0
        )
        large = np.nonzero(longest > 1.7 * grading.allowed(corners.mean(axis=1).T))[0]
        if not len(large):
            return mesh
        if mesh.t.shape[1] > 60_000:
            break
        mesh = mesh.refined(large)
    finest = grading.fine.min(initial=SEAM)
    raise MeshError(
        f"{mesh.t.shape[1]} elements do not reach edges of {finest * 1e3:.2g} mm; "
        "choose a coarser grid"
    )


def _heights(height: float, count: int, grading: TetGrading) -> FloatArray:
    """Boundaries of element layers before refinement (k,) [m]."""
    if not grading.levels:
        return np.linspace(0.0, height, count + 1)
    ends = [0.0, *sorted(grading.levels), height]
    parts = [
        np.linspace(low, high, 1 + int(np.ceil((high - low) / grading.coarse)))
        for low, high in pairwise(ends)
    ]
    return np.unique(np.concatenate(parts))


def _sampling(basis: Any) -> Sampling:
    values = np.array(
        [np.broadcast_to(np.asarray(part[0]), basis.dx.shape) for part in basis.basis]
    )
    return Sampling(
        owner=np.asarray(basis.tind, dtype=np.int64),
        values=np.ascontiguousarray(np.transpose(values, (1, 2, 0))),
        weights=np.ascontiguousarray(basis.dx),
    )


def _operator(basis: Any, elements: IntArray, count: int) -> Any:
    sampling = _sampling(basis)
    facets, points, _ = sampling.values.shape
    rows = np.repeat(np.arange(facets * points), 10)
    columns = np.repeat(elements[sampling.owner], points, axis=0).ravel()
    return sparse.csr_matrix(
        (sampling.values.ravel(), (rows, columns)), shape=(facets * points, count)
    )


def _lattice(divisions: int) -> tuple[FloatArray, IntArray]:
    """Points (2, k) of a regularly divided reference triangle and its (t, 3) small triangles."""
    index = {(i, j): 0 for j in range(divisions + 1) for i in range(divisions + 1 - j)}
    index = {key: number for number, key in enumerate(index)}
    triangles = []
    for i, j in index:
        if i + j < divisions:
            triangles.append((index[i, j], index[i + 1, j], index[i, j + 1]))
        if i + j < divisions - 1:
            triangles.append((index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]))
    return np.array(list(index), dtype=float).T / divisions, np.array(triangles, dtype=np.int64)


def shape_values() -> FloatArray:
    """Shape functions (4, 10) of the ten-node tetrahedron at its volume points, in scikit-fem's
    order.
    """
    from skfem import ElementTetP2
    from skfem.quadrature import get_quadrature

    element = ElementTetP2()
    places, _ = get_quadrature(element, 2)
    return np.array([element.lbasis(places, number)[0] for number in range(10)]).T
