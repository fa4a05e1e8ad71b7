"""A step that draws the surface anew around everything that is inside it.

It resolves crossings, walls inside, bodies that overlap, and edges of more than two triangles.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations
from typing import Any

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["Rebuild"]

_MOST_NODES = 2 * 10**7
"""Nodes of the grid, which bounds time and memory."""
_MARGIN = 2.137
"""Cells between the surface and the end of the grid, odd so that no plane of the body lies on
the grid [1]."""
_LEAST_SHARE = 0.02
"""A vertex keeps this distance from the nodes over the length of the grid's edge [1]."""
_CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
_TETRAHEDRA = np.array([(0, 4 >> a, (4 >> a) + (4 >> b), 7) for a, b, _ in permutations(range(3))])
"""Corners of the six tetrahedra around a cube's diagonal (Kuhn)."""
_FACES: dict[int, tuple[tuple[int, ...], ...]] = {
    1: ((0, 1, 0, 2, 0, 3),),
    2: ((0, 2, 0, 3, 1, 3), (0, 2, 1, 3, 1, 2)),
    3: ((0, 3, 1, 3, 2, 3),),
}
"""Ends of the cut edges of a tetrahedron whose first 1, 2 or 3 corners are inside."""


@dataclass(frozen=True)
class Rebuild:
    """Replace the surface by the border of its inside on a grid, by marching tetrahedra.

    A node is inside where the winding number along at least two of the three axes is not zero, so
    that a hole across one axis does no harm.

    Attributes:
        cell: edge length of the grid [m]; edges of the body are rounded by about half of it.
    """

    cell: float
    title = "rebuild"
    unmoved = ""

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Draw the surface anew; MeshError where the grid would be too fine, or nothing is
        inside.
        """
        low = surface.vertices.min(axis=0) - _MARGIN * self.cell
        extent = np.ptp(surface.vertices, axis=0) + 2 * _MARGIN * self.cell
        counts = np.ceil(extent / self.cell).astype(int) + 1
        if np.prod(counts.astype(float)) > _MOST_NODES:
            least = self.cell * (float(np.prod(counts.astype(float))) / _MOST_NODES) ** (1 / 3)
            raise MeshError(
                f"{surface.name}: a grid of {1e3 * self.cell:g} mm has "
                f"{np.prod(counts.astype(float)):.3g} nodes, at most {_MOST_NODES:.0e} are used: "
                f"--rebuild {1.05e3 * least:.2g} or more",
                file=surface.name,
                cell=self.cell,
                low=least,
            )
        scene = _scene(surface, low, self.cell)
        inside = _inside(scene, surface, counts)
        if not inside.any():
            raise MeshError(
                f"{surface.name}: no node of a grid of {1e3 * self.cell:g} mm lies inside; close "
                "the surface first, or use a smaller --rebuild",
                file=surface.name,
                cell=self.cell,
            )
        vertices, triangles = _marched(scene, inside)
        made = surface.of(triangles, low + self.cell * vertices)
        nodes = " x ".join(str(count) for count in counts)
        return made, f"drawn anew on a grid of {1e3 * self.cell:g} mm, {nodes} nodes"


def _scene(surface: TriangleSurface, low: FloatArray, cell: float) -> Any:
    """Open3D's scene of a surface in units of the grid."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(((surface.vertices - low) / cell).astype(np.float32)),
        o3d.core.Tensor.from_numpy(surface.triangles.astype(np.uint32)),
    )
    return scene


def _inside(scene: Any, surface: TriangleSurface, counts: IntArray) -> BoolArray:
    """Mark nodes (a, b, c) around which the surface winds, along two of three axes at least."""
    import open3d as o3d

    corners = surface.corners
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    votes = np.zeros(counts, np.int8)
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        rows, columns = counts[others]
        rays = np.zeros((rows, columns, 6), np.float32)
        grid = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
        rays[..., others[0]], rays[..., others[1]] = grid
        rays[..., 3 + axis] = 1.0
        hits = scene.list_intersections(o3d.core.Tensor.from_numpy(rays.reshape(-1, 6)))
        after = np.ceil(hits["t_hit"].numpy()).astype(np.int64)
        turn = -np.sign(across[hits["primitive_ids"].numpy().astype(np.int64), axis])
        winding = np.zeros((rows * columns, counts[axis] + 1))
        np.add.at(winding, (hits["ray_ids"].numpy().astype(np.int64), after), turn)
        wound = np.cumsum(winding[:, :-1], axis=1) != 0
        votes += np.moveaxis(wound.reshape(rows, columns, -1), -1, axis)
    return votes >= 2


def _marched(scene: Any, inside: BoolArray) -> tuple[FloatArray, IntArray]:
    """Vertices (v, 3) in units of the grid and outward triangles of the border of its inside."""
    import open3d as o3d

    counts = np.array(inside.shape)
    cubes = [
        inside[tuple(slice(c, n - 1 + c) for c, n in zip(corner, counts, strict=True))]
        for corner in _CUBE
    ]
    total = np.sum(cubes, axis=0, dtype=np.int8)
    first = np.argwhere((total > 0) & (total < len(_CUBE)))
    nodes = np.ravel_multi_index((first[:, None] + _CUBE).reshape(-1, 3).T, tuple(counts))
    tetrahedra = nodes.reshape(-1, len(_CUBE))[:, _TETRAHEDRA].reshape(-1, 4)
    within = inside.ravel()
    order = np.argsort(~within[tetrahedra], axis=1, kind="stable")
    tetrahedra = np.take_along_axis(tetrahedra, order, axis=1)
    filled = within[tetrahedra].sum(axis=1)
    ends = np.concatenate(
        [tetrahedra[filled == k][:, face] for k, faces in _FACES.items() for face in faces]
    ).reshape(-1, 2)
    # Each edge runs from the inside to the outside.
    edges, numbers = np.unique(ends, axis=0, return_inverse=True)
    used, row = np.unique(edges, return_inverse=True)
    places = np.stack(np.unravel_index(used, tuple(counts)), axis=1).astype(float)
    away = scene.compute_distance(o3d.core.Tensor.from_numpy(places.astype(np.float32))).numpy()
    row = row.reshape(-1, 2)
    one, other = away[row[:, 0]], away[row[:, 1]]
    share = np.clip(one / np.maximum(one + other, 1e-9), _LEAST_SHARE, 1 - _LEAST_SHARE)[:, None]
    vertices = (1 - share) * places[row[:, 0]] + share * places[row[:, 1]]
    triangles = numbers.reshape(-1, 3)
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    outwards = (places[row[:, 1]] - places[row[:, 0]])[triangles].mean(axis=1)
    wrong = np.einsum("ti,ti->t", np.cross(b - a, c - a), outwards) < 0
    triangles[wrong] = triangles[wrong][:, ::-1]
    return vertices, triangles
