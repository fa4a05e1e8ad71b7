"""The free surface of a body of any shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.setup.phantom_geometry import LEAST_EDGE, PATCH, SPACING, Geometry, Surface

__all__ = ["ShapeSurface"]

_SHARP = np.radians(40.0)
"""Triangles that meet at a larger angle than this have an edge between them [rad]."""
_ROUNDS = 8
"""Rounds in which the patches' centres are moved to the middle of their patches."""


@dataclass(frozen=True, eq=False)
class ShapeSurface(Surface):
    """The part of a closed surface that is not held, in triangles of even size.

    Sides end at sharp edges and at the border of what is held. Patches are the Voronoi cells of
    evenly spread centres, within each side.

    Attributes:
        geometry: the body.
        corners: (t, 3, 3) free triangles [m], counter-clockwise from outside.
        spacing: largest distance of vertices [m].
        patch: approximate edge length of a patch [m].
        edge: distance to an edge of a side below which points are left out [m].
    """

    geometry: Geometry
    corners: FloatArray
    spacing: float = SPACING
    patch: float = PATCH
    edge: float = LEAST_EDGE

    @cached_property
    def _joined(self) -> tuple[FloatArray, IntArray]:
        """Vertices and triangles of the free surface as it is stated."""
        vertices, index = np.unique(self.corners.reshape(-1, 3), axis=0, return_inverse=True)
        return vertices, index.reshape(-1, 3)

    @cached_property
    def _borders(self) -> tuple[IntArray, FloatArray]:
        """Number of the side of each stated triangle (t,), and the ends (e, 2, 3) [m] of all edges
        of sides.
        """
        import trimesh

        vertices, faces = self._joined
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        smooth = mesh.face_adjacency_angles < _SHARP
        pairs = mesh.face_adjacency[smooth]
        joined = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(faces), len(faces)))
        side = connected_components(joined, directed=False)[1].astype(np.int64)
        lines = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        ends, uses = np.unique(lines, axis=0, return_counts=True)
        sharp = mesh.face_adjacency_edges[~smooth]
        return side, vertices[np.concatenate([ends[uses == 1], np.sort(sharp, axis=1)])]

    @cached_property
    def _mesh(self) -> tuple[FloatArray, IntArray, IntArray]:
        """Vertices, triangles and their sides, with no edge longer than the spacing."""
        import trimesh

        remesh: Any = trimesh.remesh
        vertices, faces, sides, count = [], [], [], 0
        side, _ = self._borders
        for number in range(int(side.max()) + 1):
            own, index = np.unique(self._joined[1][side == number], return_inverse=True)
            fine, triangles = remesh.subdivide_to_size(
                self._joined[0][own], index.reshape(-1, 3), self.spacing, max_iter=20
            )
            fine, merged = np.unique(fine, axis=0, return_inverse=True)
            vertices.append(fine)
            faces.append(merged[triangles] + count)
            sides.append(np.full(len(triangles), number))
            count += len(fine)
        return (
            np.concatenate(vertices),
            np.concatenate(faces).astype(np.int32),
            np.concatenate(sides),
        )

    @cached_property
    def _normals(self) -> tuple[FloatArray, FloatArray]:
        """Outward normals (t, 3) and areas (t,) [m^2] of the triangles."""
        a, b, c = self.vertices[self.faces.T]
        across = np.cross(b - a, c - a)
        twice = np.linalg.norm(across, axis=1)
        return across / twice[:, None], twice / 2

    @cached_property
    def _partition(self) -> tuple[FloatArray, FloatArray, IntArray]:
        """Centres (p, 3) [m], normals (p, 3) and sides (p,) of the patches."""
        middles = self.vertices[self.faces].mean(axis=1)
        normals, areas = self._normals
        parts = []
        for number in range(int(self.side.max()) + 1):
            on = np.flatnonzero(self.side == number)
            count = max(1, round(float(areas[on].sum()) / self.patch**2))
            centres = _spread(middles[on], areas[on], count)
            nearest = cKDTree(centres).query(middles[on])[1]
            normal = np.stack(
                [
                    np.bincount(nearest, areas[on] * normals[on, axis], minlength=len(centres))
                    for axis in range(3)
                ],
                axis=1,
            )
            length = np.linalg.norm(normal, axis=1, keepdims=True)
            parts.append((centres, normal / np.maximum(length, 1e-30), number))
        return (
            np.concatenate([centres for centres, _, _ in parts]),
            np.concatenate([normal for _, normal, _ in parts]),
            np.concatenate([np.full(len(centres), number) for centres, _, number in parts]),
        )

    @property
    def patches(self) -> int:
        """Number of patches on all sides."""
        return len(self._partition[0])

    @property
    def patch_centres(self) -> FloatArray:
        """(p, 3) rest positions of the patches' centres [m]."""
        return self._partition[0]

    @property
    def patch_normals(self) -> FloatArray:
        """(p, 3) outward normals of the patches at rest."""
        return self._partition[1]

    @property
    def patch_sides(self) -> IntArray:
        """(p,) numbers of the patches' sides."""
        return self._partition[2]

    def patch_of(self, points: FloatArray, side: IntArray) -> IntArray:
        """Patch numbers (m,) of rest positions (m, 3) [m] on sides (m,)."""
        centres, _, sides = self._partition
        result = np.zeros(len(points), dtype=np.int64)
        for number in np.unique(side):
            own, on = np.flatnonzero(sides == number), side == number
            result[on] = own[cKDTree(centres[own]).query(points[on])[1]]
        return result

    @cached_property
    def _edge_points(self) -> cKDTree:
        """Points on the edges of sides, closer to one another than a twentieth of a patch."""
        _, ends = self._borders
        if not len(ends):
            return cKDTree(np.full((1, 3), np.inf))
        lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        counts = np.ceil(lengths / (0.05 * self.patch)).astype(int) + 1
        shares = np.concatenate([np.linspace(0, 1, count) for count in counts])[:, None]
        first, last = (np.repeat(ends[:, end], counts, axis=0) for end in (0, 1))
        return cKDTree((1 - shares) * first + shares * last)

    def edge_distance(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Distance (m,) [m] of rest positions to the nearest edge of any side."""
        return np.asarray(self._edge_points.query(points)[0])

    def tangents(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Unit vectors (2, m, 3) along the surface, see `Surface.tangents`."""
        return _tangents(self._normal_at(points, side))

    def _normal_at(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Outward normals (m, 3) of the triangle whose middle is nearest on each point's side."""
        middles, (normals, _) = self.vertices[self.faces].mean(axis=1), self._normals
        result = np.zeros((len(points), 3))
        for number in np.unique(side):
            own, on = np.flatnonzero(self.side == number), side == number
            result[on] = normals[own[cKDTree(middles[own]).query(points[on])[1]]]
        return result


def _spread(places: FloatArray, weights: FloatArray, count: int) -> FloatArray:
    """Evenly spread centres (count, 3) among weighted places (n, 3): the farthest place from all
    before it, then Lloyd's rounds.
    """
    count = min(count, len(places))
    chosen = [
        int(np.linalg.norm(places - np.average(places, axis=0, weights=weights), axis=1).argmin())
    ]
    apart = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.linalg.norm(places - places[chosen[-1]], axis=1))
    centres = places[chosen]
    for _ in range(_ROUNDS):
        nearest = cKDTree(centres).query(places)[1]
        total = np.bincount(nearest, weights, minlength=count)
        middle = np.stack(
            [np.bincount(nearest, weights * places[:, axis], minlength=count) for axis in range(3)],
            axis=1,
        )
        centres = middle / np.maximum(total, 1e-30)[:, None]
    # A centre lies on the surface.
    return np.asarray(places[cKDTree(places).query(centres)[1]])


def _tangents(normals: FloatArray) -> FloatArray:
    """Two unit vectors (2, m, 3) across each normal (m, 3), whose cross product it is."""
    away = np.eye(3)[np.abs(normals).argmin(axis=1)]
    first = np.cross(normals, away)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(normals, first)])
