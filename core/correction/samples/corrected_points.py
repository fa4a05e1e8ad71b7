"""The material points that a network corrects, their edges, and their visible surface.

A network works on the points of a grid (`palpate.correction.samples.embedding_grid`). Where the
free surface lies in the faces of this grid, as a block's does, it is interpolated between its
points, as in `palpate.measurement.metrics`. Any other surface has points of its own: they are
simulated as the grid's are, and follow the grid's correction.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from scipy.spatial import cKDTree

from palpate.correction.samples.embedding_grid import EmbeddingGrid, seen_from_above
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.mesh.protocol import Mesh
from palpate.setup.phantom_geometry import Geometry

__all__ = ["FOLD", "Body"]

FOLD = 3
"""Super-sampling of the surface along each axis, by linear interpolation (Wu et al. 2020)."""
_SAME = 1e-9
"""Points so near to each other are one [m]."""


@dataclass(frozen=True, eq=False)
class Body:
    """Material points, their edges and their surface.

    The first n points are those that the network corrects, the nodes; c points of the surface may
    follow.

    Attributes:
        rest: (v, 3) rest positions [m], phantom frame, v = n + c.
        edges: (2, e) pairs of neighbouring nodes, each in both directions.
        voxel: (3,) distance of neighbours along x, y, z [m]; the unit of a correction's bound.
        corners: (s, k) points between which each vertex of the sampled surface lies.
        shares: (s, k) linear weights of these points [1].
        grid: number of nodes along x, y (and z) of a grid, x fastest; None for any other mesh.
        index: (v,) numbers of these points among those of the samples.
        flat: whether the nodes lie over the top, which is compared with points of the top only.
        carriers: (c, k) nodes whose correction each further point follows.
        carried: (c, k) linear weights of these nodes [1].
    """

    rest: FloatArray
    edges: IntArray
    voxel: FloatArray
    corners: IntArray
    shares: FloatArray
    grid: tuple[int, ...] | None
    index: IntArray
    flat: bool = False
    carriers: IntArray = field(default_factory=lambda: np.zeros((0, 1), dtype=np.int64))
    carried: FloatArray = field(default_factory=lambda: np.zeros((0, 1)))

    @classmethod
    def of(cls, geometry: Geometry, nodes: tuple[int, int, int]) -> Self:
        """Return a grid of so many points along x, y, z through the bounds of a body, with its
        free surface.
        """
        grid = EmbeddingGrid(geometry, nodes)
        return cls._on(grid, geometry.surface_points(_sampling(nodes)))

    def over(self, geometry: Geometry) -> Self:
        """Return the grid over the top of the same body, with the surface that is seen from above.

        Raises CorrectionError where this body is no grid of three axes.
        """
        if self.grid is None or len(self.grid) != 3:
            raise CorrectionError(
                "only a grid of three axes has a top layer; take kind graph for other meshes",
                key="kind",
            )
        nx, ny, nz = self.grid
        grid = EmbeddingGrid(geometry, (nx, ny, nz), flat=True)
        places = geometry.surface_points(_sampling(grid.nodes))
        seen = seen_from_above(geometry, places)
        made = type(self)._on(grid, places[seen], in_faces=not len(self.carriers))
        # Points that both have are sampled once.
        apart, known = cKDTree(self.rest).query(grid.points)
        fresh = apart > _SAME
        numbers = np.where(fresh, len(self.rest) + np.cumsum(fresh) - 1, known)
        surface = self.count + np.flatnonzero(seen)[: len(made.carriers)]
        return replace(made, index=np.concatenate([numbers, surface]))

    @classmethod
    def _on(cls, grid: EmbeddingGrid, places: FloatArray, in_faces: bool | None = None) -> Self:
        """Return the points of a grid with a surface sampled at places (s, 3) [m]."""
        points, shares = grid.between(places)
        nx, ny, nz = grid.nodes
        count, edges = len(grid.points), _grid_edges((nx, ny, 1 if grid.flat else nz))
        if grid.holds(places) if in_faces is None else in_faces:
            heaviest = np.argsort(-shares, axis=1, kind="stable")[:, :4]
            return cls(
                grid.points,
                edges,
                grid.voxel,
                np.take_along_axis(points, heaviest, 1),
                np.take_along_axis(shares, heaviest, 1),
                grid.shape,
                np.arange(count),
                grid.flat,
            )
        return cls(
            np.concatenate([grid.points, places]),
            edges,
            grid.voxel,
            count + np.arange(len(places))[:, None],
            np.ones((len(places), 1)),
            grid.shape,
            np.arange(count + len(places)),
            grid.flat,
            points,
            shares,
        )

    @property
    def count(self) -> int:
        """Number of nodes."""
        return len(self.rest) - len(self.carriers)

    @property
    def nodes(self) -> IntArray:
        """Numbers (n,) of the nodes among the points of the samples."""
        return self.index[: self.count]

    def carry(self, values: FloatArray) -> FloatArray:
        """Return values (v, ...) at all points of values (n, ...) at the nodes."""
        further = np.einsum("ck,ck...->c...", self.carried, values[self.carriers])
        return np.concatenate([values, further])

    def gather(self, counts: FloatArray) -> FloatArray:
        """Return numbers of things (n,) near the nodes of numbers (v,) near all points."""
        near = np.array(counts[: self.count], dtype=float)
        np.add.at(near, self.carriers, self.carried * counts[self.count :, None])
        return near

    @classmethod
    def of_mesh(cls, mesh: Mesh) -> Self:
        """Return the nodes of any mesh; edges are those of its elements and of its surface."""
        hull = mesh.connectivity.hull
        free = hull[~np.isin(hull, mesh.connectivity.base_nodes).all(axis=1)]
        edges, nodes = _mesh_edges(mesh), np.array(mesh.nodes)
        # The same along all axes: the elements of an unstructured mesh have no axes.
        voxel = np.full(3, float(np.linalg.norm(nodes[edges[0]] - nodes[edges[1]], axis=1).mean()))
        return cls(nodes, edges, voxel, *_subdivided(free), None, np.arange(len(nodes)))

    def surface(self, vertices: FloatArray) -> FloatArray:
        """Return the super-sampled surface (..., s, 3) [m] of vertices (..., v, 3) [m]."""
        return np.asarray(
            np.einsum("sk,...skc->...sc", self.shares, vertices[..., self.corners, :])
        )

    def to_arrays(self) -> dict[str, Any]:
        """Return arrays and plain values for a file."""
        plain = {item.name: getattr(self, item.name) for item in fields(self)}
        return {**plain, "grid": None if self.grid is None else list(self.grid)}

    @classmethod
    def from_arrays(cls, data: dict[str, Any]) -> Self:
        """Return the body that `to_arrays` wrote; arrays may be any that NumPy reads."""
        plain = {
            name: np.asarray(value) for name, value in data.items() if name not in ("grid", "flat")
        }
        grid = None if data["grid"] is None else tuple(int(n) for n in data["grid"])
        return cls(**plain, grid=grid, flat=bool(data["flat"]))


def _sampling(nodes: tuple[int, int, int]) -> tuple[int, int, int]:
    """Return the points along x, y, z of the super-sampled grid."""
    nx, ny, nz = (FOLD * (count - 1) + 1 for count in nodes)
    return nx, ny, nz


def _grid_edges(nodes: tuple[int, int, int]) -> IntArray:
    """Return the neighbours along the axes (2, e)."""
    numbers = np.arange(np.prod(nodes)).reshape(nodes[::-1])
    pairs = [
        np.stack([numbers[1:].ravel(), numbers[:-1].ravel()]),
        np.stack([numbers[:, 1:].ravel(), numbers[:, :-1].ravel()]),
        np.stack([numbers[:, :, 1:].ravel(), numbers[:, :, :-1].ravel()]),
    ]
    one_way = np.concatenate(pairs, axis=1)
    return np.concatenate([one_way, one_way[::-1]], axis=1)


def _mesh_edges(mesh: Mesh) -> IntArray:
    """Return the edges of elements and of the hull (2, e).

    Two nodes of an element form an edge, and not a diagonal, where no third node is nearer to both.
    """
    elements, hull = mesh.connectivity.elements, mesh.connectivity.hull
    corners = np.asarray(mesh.nodes[elements])
    apart = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3)
    own = np.arange(elements.shape[1])
    apart[:, own, own] = np.inf
    way_round = np.maximum(apart[:, :, None], apart[:, None]).min(axis=3)
    element, first, second = np.nonzero(apart <= way_round * (1 + 1e-9))
    inner = np.stack([elements[element, first], elements[element, second]])
    rim = np.stack([hull.ravel(), np.roll(hull, -1, axis=1).ravel()])
    both = np.concatenate([inner, rim, rim[::-1]], axis=1)
    return np.ascontiguousarray(np.unique(both[:, both[0] != both[1]], axis=1))


def _subdivided(polygons: IntArray) -> tuple[IntArray, FloatArray]:
    """Return corners and shares (s, 3) of points on triangles or quadrilaterals (f, 3 or 4).

    Each side is divided into FOLD steps; each point occurs once.
    """
    if polygons.shape[1] == 4:
        polygons = np.concatenate([polygons[:, [0, 1, 2]], polygons[:, [0, 2, 3]]])
    parts = np.array([(i, j, FOLD - i - j) for i in range(FOLD + 1) for j in range(FOLD + 1 - i)])
    corners = np.broadcast_to(polygons[:, None], (len(polygons), len(parts), 3)).reshape(-1, 3)
    steps = np.broadcast_to(parts, (len(polygons), *parts.shape)).reshape(-1, 3)
    # A point on an edge belongs to two triangles, with the same corners and weights in both.
    key = np.sort(np.where(steps > 0, corners * (FOLD + 1) + steps, -1), axis=1)
    _, once = np.unique(key, axis=0, return_index=True)
    return corners[once], steps[once] / FOLD
