"""The material points that a network corrects, their edges, and their visible surface.

The points sample the solved mesh, as in `palpate.measurement.metrics`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError
from palpate.mesh.box_mesh import BoxMesh, GridSpec, box_mesh
from palpate.mesh.protocol import Mesh

__all__ = ["FOLD", "Body"]

FOLD = 3
"""Super-sampling of the surface along each axis, by linear interpolation (Wu et al. 2020)."""


@dataclass(frozen=True, eq=False)
class Body:
    """Material points, their edges and their surface.

    Attributes:
        rest: (v, 3) rest positions [m], phantom frame.
        edges: (2, e) pairs of neighbours, each in both directions.
        voxel: (3,) distance of neighbours along x, y, z [m]; the unit of a correction's bound.
        corners: (s, k) points between which each vertex of the super-sampled surface lies.
        shares: (s, k) linear weights of these points [1].
        grid: number of points along x, y (and z) of a grid, x fastest; None for any other mesh.
        index: (v,) numbers of these points among those of the samples.
        flat: whether the body is the top layer, which is compared with points of the top only.
    """

    rest: FloatArray
    edges: IntArray
    voxel: FloatArray
    corners: IntArray
    shares: FloatArray
    grid: tuple[int, ...] | None
    index: IntArray
    flat: bool = False

    @classmethod
    def block(cls, size: tuple[float, float, float], nodes: tuple[int, int, int]) -> Self:
        """Return the points of a regular grid through a block.

        The surface is the top and the four sides.

        Args:
            size: (x, y, z) edge lengths of the block [m].
            nodes: number of points along x, y, z.
        """
        mesh, dense = _grids(size, nodes)
        places = dense.nodes[np.unique(dense.free_surface)]
        every = np.arange(len(mesh.nodes))
        return cls(
            mesh.nodes,
            _grid_edges(nodes),
            _voxel(size, nodes),
            *_between(mesh, places, every),
            nodes,
            every,
        )

    @classmethod
    def top(cls, size: tuple[float, float, float], nodes: tuple[int, int, int]) -> Self:
        """Return the top layer of the same grid."""
        mesh, dense = _grids(size, nodes)
        flat = (nodes[0], nodes[1])
        index = np.arange(len(mesh.nodes))[-nodes[0] * nodes[1] :]
        places = dense.nodes[np.unique(dense.faces["+z"])]
        edges = _grid_edges((*flat, 1))
        return cls(
            mesh.nodes[index],
            edges,
            _voxel(size, nodes),
            *_between(mesh, places, index),
            flat,
            index,
            True,
        )

    @property
    def upper(self) -> Self:
        """The top layer of a grid; CorrectionError for any other body."""
        if self.grid is None or len(self.grid) != 3:
            raise CorrectionError(
                "only a grid of three axes has a top layer; take kind graph for other meshes",
                key="kind",
            )
        nx, ny, nz = self.grid
        x, y, z = (float(length) for length in np.ptp(self.rest, axis=0))
        return type(self).top((x, y, z), (nx, ny, nz))

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


def _grids(
    size: tuple[float, float, float], nodes: tuple[int, int, int]
) -> tuple[BoxMesh, BoxMesh]:
    """Return the grid and the super-sampled one."""
    if len(nodes) != 3 or min(nodes) < 2:
        raise CorrectionError(
            f"a grid has two points or more along each of three axes, got {nodes}", key="nodes"
        )
    nx, ny, nz = (FOLD * (n - 1) + 1 for n in nodes)
    return box_mesh(size, GridSpec(nodes=nodes)), box_mesh(size, GridSpec(nodes=(nx, ny, nz)))


def _voxel(size: tuple[float, float, float], nodes: tuple[int, int, int]) -> FloatArray:
    return np.asarray(np.array(size) / (np.array(nodes) - 1))


def _between(mesh: BoxMesh, places: FloatArray, index: IntArray) -> tuple[IntArray, FloatArray]:
    """Return corners and shares (s, 4) of places (s, 3) [m] on the surface.

    Corners are numbers within `index` (v,), the nodes that are used.
    """
    nodes, shares = mesh.locate(places)
    heaviest = np.argsort(-shares, axis=1, kind="stable")[:, :4]
    nodes, shares = np.take_along_axis(nodes, heaviest, 1), np.take_along_axis(shares, heaviest, 1)
    number = np.full(len(mesh.nodes), -1)
    number[index] = np.arange(len(index))
    own = number[nodes]
    # A corner outside `index` has no weight, so that any other corner can replace it.
    return np.where(own < 0, own.max(axis=1, keepdims=True), own), np.where(own < 0, 0.0, shares)


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
