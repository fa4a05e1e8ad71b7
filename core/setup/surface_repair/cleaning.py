"""Steps that remove what encloses nothing: doubled vertices and triangles, fins, other bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from palpate.foundation.arrays import BoolArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.setup.surface_repair.surface_summary import flat_triangles, repeated_triangles
from palpate.setup.surface_repair.surface_topology import SurfaceEdges
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["Clean", "KeepBody", "body_volumes"]

_ROUNDS = 50
"""Rounds in which triangles without an area, or fins, are looked for."""


@dataclass(frozen=True)
class Clean:
    """Merge vertices, and remove triangles that are doubled, have no area, or stick out as fins.

    Attributes:
        distance: vertices nearer than this are merged [m].
    """

    distance: float
    title = "clean"
    unmoved = ""

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Clean the surface."""
        vertices = len(surface.vertices)
        merged = surface.of(_merged(surface, self.distance))
        fewer = vertices - len(merged.vertices)
        corners = np.sort(merged.triangles, axis=1)
        whole = merged.of(merged.triangles[(np.diff(corners, axis=1) != 0).all(axis=1)])
        single = whole.of(whole.triangles[~repeated_triangles(whole)])
        bare = _without_fins(single)
        clean, swaps = _without_flat(bare)
        said = (
            f"merged {fewer} vertices, removed {len(merged.triangles) - len(whole.triangles)} "
            f"collapsed and {len(whole.triangles) - len(single.triangles)} doubled triangles and "
            f"{len(single.triangles) - len(bare.triangles)} of fins"
        )
        return clean, said + (f", turned {swaps} edges of triangles without an area" * bool(swaps))


def _merged(surface: TriangleSurface, distance: float) -> IntArray:
    """Triangles of a surface after vertices nearer than a distance [m] became the first of them."""
    count = len(surface.vertices)
    near = cKDTree(surface.vertices).query_pairs(distance, output_type="ndarray")
    if not len(near):
        return surface.triangles
    graph = sp.coo_matrix((np.ones(len(near), bool), (near[:, 0], near[:, 1])), shape=(count,) * 2)
    _, group = connected_components(graph, directed=False)
    _, first = np.unique(group, return_index=True)
    return np.asarray(first[group][surface.triangles], dtype=np.int64)


def _without_flat(surface: TriangleSurface) -> tuple[TriangleSurface, int]:
    """Turn the longest edge of each triangle without an area to the corner opposite, which makes
    two triangles with an area of it and its neighbour.

    Returns:
        the surface, and the number of edges that were turned.
    """
    total = 0
    for _ in range(_ROUNDS):
        flat = np.flatnonzero(flat_triangles(surface))
        if not len(flat):
            break
        swapped = _swapped(surface, flat)
        if not swapped[1]:
            break
        surface, total = surface.of(swapped[0]), total + swapped[1]
    return surface, total


def _swapped(surface: TriangleSurface, flat: IntArray) -> tuple[IntArray, int]:
    """Triangles after the longest edges of some triangles were turned, and their number."""
    triangles = surface.triangles.copy()
    corners = surface.corners[flat]
    longest = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).argmax(axis=1)
    partner = np.full(3 * len(triangles), -1)
    pairs = SurfaceEdges(triangles).pairs
    partner[pairs[:, 0]], partner[pairs[:, 1]] = pairs[:, 1], pairs[:, 0]
    touched, count = set[int](), 0
    for triangle, side in zip(flat, longest, strict=True):
        other = int(partner[3 * triangle + side])
        if other < 0 or {int(triangle), other // 3} & touched:
            continue
        a, b, c = np.roll(triangles[triangle], -side)
        start, end, far = np.roll(triangles[other // 3], -(other % 3))
        if (start, end) != (b, a) or far == c:
            continue  # flipped against each other: to be oriented first
        triangles[triangle], triangles[other // 3] = (a, far, c), (far, b, c)
        touched |= {int(triangle), other // 3}
        count += 1
    return triangles, count


def _without_fins(surface: TriangleSurface) -> TriangleSurface:
    """Remove triangles that hang on an edge of more than two and have a free edge, again and
    again.
    """
    for _ in range(_ROUNDS):
        if not len(surface.triangles):
            break
        uses = SurfaceEdges(surface.triangles).uses_of_sides.reshape(-1, 3)
        fins = (uses == 1).any(axis=1) & (uses > 2).any(axis=1)
        if not fins.any():
            break
        surface = surface.of(surface.triangles[~fins])
    return surface


def body_volumes(surface: TriangleSurface) -> list[tuple[BoolArray, float]]:
    """Triangles (t,) of each body and the volume of its bounding box [m^3], the largest first."""
    bodies = SurfaceEdges(surface.triangles).bodies
    count = int(bodies.max(initial=-1)) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, bodies, surface.corners.min(axis=1))
    np.maximum.at(high, bodies, surface.corners.max(axis=1))
    boxes = np.prod(high - low, axis=1)
    return [(bodies == body, float(boxes[body])) for body in np.argsort(-boxes, kind="stable")]


@dataclass(frozen=True)
class KeepBody:
    """Keep one body: by the size of its bounding box, number 1 is the largest.

    Attributes:
        number: of the body, from 1.
    """

    number: int = 1
    title = "body"
    unmoved = ""

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Keep the body; MeshError where there are not so many."""
        bodies = body_volumes(surface)
        if self.number > len(bodies):
            raise MeshError(
                f"{surface.name}: holds {len(bodies)} bodies, number {self.number} was asked for; "
                f"name one from 1, the largest, to {len(bodies)}",
                file=surface.name,
                bodies=len(bodies),
            )
        kept, _ = bodies[self.number - 1]
        lost = len(kept) - int(kept.sum())
        return surface.of(surface.triangles[kept]), (
            f"kept body {self.number} of {len(bodies)}, {kept.sum()} triangles; removed {lost}"
        )
