"""Meshes of quadratic tetrahedra with straight edges."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.mesh.elements import EDGES, TET10, quadratic_gradients, shapes_of
from palpate.mesh.interpolation import weighted_nodes
from palpate.mesh.protocol import Connectivity
from palpate.setup.free_form.closest_point import containing, nearest

__all__ = ["TetMesh", "sides_of", "stretched"]

_SIDES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
"""Corners of a tetrahedron's sides, counter-clockwise from outside."""
_QUARTERS = ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5))
"""The four triangles between the six nodes of a side."""
_REMEMBERED = 6
"""Sets of points whose places in a mesh are cached."""
_GRIDDED = 2.5e-3
"""Largest spacing of the grid on which a picture of the inside is drawn [m]."""
_ON_THE_EDGE = 1e-9
"""A point of the surface may lie so far outside a tetrahedron by rounding, in barycentric
coordinates [1]."""


@lru_cache(maxsize=256)
def stretched(mesh: TetMesh, factors: tuple[float, float, float]) -> TetMesh:
    """Scale a mesh of a stated body; the same object for the same factors [1]."""
    return mesh.scaled(np.array(factors))


def sides_of(tetrahedra: IntArray) -> IntArray:
    """Corners (f, 3) of the boundary sides of tetrahedra (e, 4), counter-clockwise from outside.

    A boundary side belongs to one tetrahedron only.
    """
    sides = tetrahedra[:, np.array(_SIDES)].reshape(-1, 3)
    _, first, uses = np.unique(
        np.sort(sides, axis=1), axis=0, return_index=True, return_counts=True
    )
    return np.asarray(sides[np.sort(first[uses == 1])])


@dataclass(frozen=True, eq=False)
class TetMesh:
    """Corners and tetrahedra of a body; nodes at the midpoints of the edges are added.

    Attributes:
        corners: (c, 3) rest positions [m], phantom frame.
        tetrahedra: (e, 4) corners, of positive volume.
        held: (f,) True for sides of `sides_of(tetrahedra)` that are held.
        near_focus: nodes (k,) of the free surface that a tool may touch, of a mesh for one push;
            a replay condenses the body on them.
    """

    corners: FloatArray
    tetrahedra: IntArray
    held: BoolArray
    near_focus: IntArray = field(default_factory=lambda: np.empty(0, dtype=np.int64))

    def __getstate__(self) -> dict[str, Any]:
        """Pickle only the defining fields; everything else is computed again on demand."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    def scaled(self, factors: FloatArray) -> TetMesh:
        """The same tetrahedra in a body whose coordinates are multiplied by these factors (3,)
        [1].
        """
        return self.with_corners(self.corners * factors)

    def with_corners(self, corners: FloatArray) -> TetMesh:
        """The same tetrahedra with their corners (c, 3) at other rest positions [m]."""
        made = replace(self, corners=corners)
        # Cached properties that do not depend on coordinates.
        vars(made).update(_edges=self._edges, connectivity=self.connectivity)
        return made

    @cached_property
    def _edges(self) -> tuple[IntArray, IntArray]:
        """Ends (k, 2) of all edges, and the edge numbers of each tetrahedron (e, 6)."""
        ends = np.sort(self.tetrahedra[:, np.array(EDGES)].reshape(-1, 2), axis=1)
        unique, inverse = np.unique(ends, axis=0, return_inverse=True)
        return unique, inverse.reshape(-1, len(EDGES))

    @cached_property
    def nodes(self) -> FloatArray:
        """Rest positions (n, 3) [m]: the corners, then the midpoints of the edges."""
        return np.concatenate([self.corners, self.corners[self._edges[0]].mean(axis=1)])

    @cached_property
    def connectivity(self) -> Connectivity:
        """Connectivity of the quadratic mesh."""
        ends, numbers = self._edges
        count = len(self.corners)
        sides = sides_of(self.tetrahedra)
        keys = ends[:, 0] * count + ends[:, 1]
        between = np.sort(sides[:, np.array(EDGES[:3])], axis=2)
        middles = np.searchsorted(keys, between[..., 0] * count + between[..., 1]) + count
        whole = np.ascontiguousarray(np.concatenate([sides, middles], axis=1))
        return Connectivity(
            element=TET10,
            count=len(self.nodes),
            elements=np.ascontiguousarray(
                np.concatenate([self.tetrahedra, numbers + count], axis=1)
            ),
            surface=np.ascontiguousarray(whole[~self.held]),
            base=np.ascontiguousarray(whole[self.held]),
            hull=np.ascontiguousarray(whole[:, np.array(_QUARTERS)].reshape(-1, 3)),
            base_nodes=np.unique(whole[self.held]),
        )

    @property
    def focus(self) -> FloatArray:
        """A constant (3,) [m]: the mesh does not follow the tool."""
        return np.zeros(3)

    def focused(self, place: FloatArray, radius: float) -> TetMesh:
        """The same mesh for a push that touches its free surface within a radius of a place (3,)
        [m].
        """
        free = np.unique(self.connectivity.surface)
        apart = np.linalg.norm(self.nodes[free] - place, axis=1)
        return replace(self, near_focus=free[apart < radius])

    @cached_property
    def axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates along x, y, z [m] of an even grid over the body."""
        low, high = self.corners.min(axis=0), self.corners.max(axis=0)
        x, y, z = (
            np.linspace(first, last, 2 + int((last - first) / _GRIDDED))
            for first, last in zip(low, high, strict=True)
        )
        return x, y, z

    @cached_property
    def _on_axes(self) -> tuple[IntArray, FloatArray]:
        """Nodes and shape functions (m, 10) at the grid of `axes`."""
        x, y, z = self.axes
        rows, columns, layers = np.meshgrid(z, y, x, indexing="ij")
        return self.locate(np.stack([layers.ravel(), columns.ravel(), rows.ravel()], axis=1))

    def on_axes(self, field: FloatArray) -> FloatArray:
        """A nodal field (n, c) at the grid of `axes` (nz ny nx, c), see `Mesh.on_axes`."""
        return weighted_nodes(*self._on_axes, field)

    @cached_property
    def _frames(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Bounding boxes and barycentric frames of the tetrahedra.

        Returns:
            lower and upper bounds (e, 3) [m], first corners (e, 3) [m], and the matrices (e, 3, 3)
                [1/m] that give barycentric coordinates.
        """
        corners = self.corners[self.tetrahedra]
        inverses = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
        slack = 1e-6 * np.ptp(corners, axis=1)
        low, high = corners.min(axis=1) - slack, corners.max(axis=1) + slack
        return low, high, np.ascontiguousarray(corners[:, 0]), np.ascontiguousarray(inverses)

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find elements' nodes and shape functions (m, 10) at rest positions (m, 3) [m].

        Points outside are moved to the surface.
        """
        element, shares = self._shares_of(points)
        return self.connectivity.elements[element], shapes_of(shares)

    def slopes(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find elements' nodes (m, 10) and the gradients of their shape functions (m, 10, 3) [1/m]
        at rest positions (m, 3) [m]; points outside are moved to the surface.
        """
        element, shares = self._shares_of(points)
        gradients = quadratic_gradients(shares) @ self._frames[3][element]
        return self.connectivity.elements[element], gradients

    def _shares_of(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Tetrahedra (m,) and barycentric coordinates (m, 4) of points (m, 3) [m].

        The last few sets of points are cached: those of a surface are asked for in every frame.
        """
        places = np.array(points, dtype=float)
        key = places.tobytes()
        if key not in self._located:
            if len(self._located) >= _REMEMBERED:
                self._located.pop(next(iter(self._located)))
            self._located[key] = self._found(places)
        return self._located[key]

    @cached_property
    def _located(self) -> dict[bytes, tuple[IntArray, FloatArray]]:
        """Results of `_shares_of` by the bytes of the points."""
        return {}

    def _found(self, places: FloatArray) -> tuple[IntArray, FloatArray]:
        """Search for `_shares_of`; moves places outside to the surface."""
        element = containing(places, *self._frames, _ON_THE_EDGE)
        outside = np.flatnonzero(element < 0)
        if len(outside):
            sides = sides_of(self.tetrahedra)
            side, places[outside] = nearest(places[outside], self.corners[sides])
            element[outside] = self._owners[side]
        _, _, origins, inverses = self._frames
        shares = np.einsum("mij,mj->mi", inverses[element], places - origins[element])
        shares = np.clip(
            np.concatenate([1 - shares.sum(axis=1, keepdims=True), shares], axis=1), 0.0, None
        )
        shares /= shares.sum(axis=1, keepdims=True)
        return element, shares

    @cached_property
    def _owners(self) -> IntArray:
        """The tetrahedron (f,) that each boundary side belongs to."""
        sides = np.sort(self.tetrahedra[:, np.array(_SIDES)].reshape(-1, 3), axis=1)
        _, first, uses = np.unique(sides, axis=0, return_index=True, return_counts=True)
        return np.asarray(np.sort(first[uses == 1]) // len(_SIDES))

    def interpolate(self, field: FloatArray, points: FloatArray) -> FloatArray:
        """Interpolate a nodal field (n, c) at rest positions (m, 3) [m]."""
        nodes, weights = self.locate(points)
        return weighted_nodes(nodes, weights, field)
