"""Signed distances of measured points to a simulated surface, along camera rays.

The error of a depth camera is along the ray. The simulated point of a measured one is therefore the
intersection of its ray with the surface, not the nearest point: nearest points follow the noise and
turn it into bias on curved or slanted parts. The distance is taken along the surface normal. 45 000
noisy points become a few hundred averages over patches of the rest surface, which move with the
material.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray, lengths
from palpate.replay.replay import Equilibrium
from palpate.setup.setup import Box, Setup

__all__ = ["Gaps", "Surface", "gaps", "gaps_beside"]

SIDES = ("+z", "-y", "+y", "-x", "+x")
"""Sides of the free surface."""
GRAZING = 0.3
"""Least cosine between ray and normal [1]; below it, depth noise moves points along the surface."""
_EDGE = 1.5e-3
"""Distance to an edge of the block below which points are left out [m], whatever is declared:
depth cameras round edges."""
_OUTLIER = 8e-3
"""Distance beyond which a point is an outlier [m]."""
_BESIDE = 1e-3
"""Distance of the material points that span a tangent plane [m]."""


@dataclass(frozen=True, eq=False)
class Surface:
    """The free surface of a block as a triangle mesh of material points, divided into patches.

    Attributes:
        geometry: the block.
        spacing: largest distance of vertices [m].
        patch: approximate edge length of a patch [m].
        stated: the block whose lengths set the numbers of vertices and patches; `geometry` if None.
        edge: distance to an edge of the block below which points are left out [m].
    """

    geometry: Box
    spacing: float = 1.5e-3
    patch: float = 4e-3
    stated: Box | None = None
    edge: float = _EDGE

    @classmethod
    def of(cls, setup: Setup, spacing: float = 1.5e-3) -> Surface:
        """The surface of a setup's block."""
        edge = max(_EDGE, setup.sensor.edge)
        return cls(setup.box, spacing=spacing, stated=setup.registered, edge=edge)

    def axes(self, side: str) -> tuple[int, int, int]:
        """Normal axis and the two axes in the plane, right-handed about the outward normal."""
        normal = "xyz".index(side[1])
        first, second = [(1, 2), (2, 0), (0, 1)][normal]
        return (normal, first, second) if side[0] == "+" else (normal, second, first)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Lowest and highest corner at rest, (3,) each [m]."""
        return self.geometry.low, self.geometry.high

    @cached_property
    def _lengths(self) -> FloatArray:
        """Edge lengths (3,) [m] of the stated block."""
        return np.array((self.stated or self.geometry).size)

    def own(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in this block of rest positions in the stated block."""
        return (
            places
            if self.stated is None
            else places * (np.array(self.geometry.size) / self._lengths)
        )

    def on_stated(self, places: FloatArray) -> FloatArray:
        """Rest positions (m, 3) [m] in the stated block, the inverse of `own`."""
        return (
            places
            if self.stated is None
            else places * (self._lengths / np.array(self.geometry.size))
        )

    @cached_property
    def _mesh(self) -> tuple[FloatArray, IntArray, IntArray]:
        low, high = self.bounds
        vertices, faces, sides, count = [], [], [], 0
        for number, side in enumerate(SIDES):
            normal, first, second = self.axes(side)
            steps = [
                max(2, int(np.ceil(self._lengths[a] / self.spacing)) + 1) for a in (first, second)
            ]
            lines = [
                np.linspace(low[a], high[a], n) for a, n in zip((first, second), steps, strict=True)
            ]
            grid = np.meshgrid(*lines, indexing="ij")
            points = np.empty((grid[0].size, 3))
            points[:, first], points[:, second] = grid[0].ravel(), grid[1].ravel()
            points[:, normal] = (high if side[0] == "+" else low)[normal]
            index = np.arange(len(points)).reshape(steps) + count
            a, b, c, d = (
                part.ravel()
                for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:])
            )
            quads = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
            vertices.append(points)
            faces.append(quads)
            sides.append(np.full(len(quads), number))
            count += len(points)
        return (
            np.concatenate(vertices),
            np.concatenate(faces).astype(np.int32),
            np.concatenate(sides),
        )

    @property
    def vertices(self) -> FloatArray:
        """(v, 3) rest positions [m]; vertices on an edge stand once per side."""
        return self._mesh[0]

    @property
    def faces(self) -> IntArray:
        """(t, 3) triangles, counter-clockwise from outside."""
        return self._mesh[1]

    @property
    def side(self) -> IntArray:
        """(t,) number in SIDES of each triangle."""
        return self._mesh[2]

    @cached_property
    def _layout(self) -> tuple[list[tuple[int, int]], IntArray]:
        shapes = []
        for side in SIDES:
            _, first, second = self.axes(side)
            nx, ny = (max(1, round(self._lengths[a] / self.patch)) for a in (first, second))
            shapes.append((nx, ny))
        return shapes, np.concatenate([[0], np.cumsum([a * b for a, b in shapes])])

    @property
    def patches(self) -> int:
        """Number of patches on all sides."""
        return int(self._layout[1][-1])

    def patch_of(self, points: FloatArray, side: IntArray) -> IntArray:
        """Patch numbers (m,) of rest positions (m, 3) [m] on sides (m,)."""
        low, high = self.bounds
        shapes, offsets = self._layout
        result = np.empty(len(points), dtype=np.int64)
        for number, name in enumerate(SIDES):
            here = side == number
            _, *plane = self.axes(name)
            cell = [
                np.clip(((points[here, a] - low[a]) / (high[a] - low[a]) * n).astype(int), 0, n - 1)
                for a, n in zip(plane, shapes[number], strict=True)
            ]
            result[here] = offsets[number] + cell[0] * shapes[number][1] + cell[1]
        return result

    @cached_property
    def patch_centres(self) -> FloatArray:
        """(p, 3) rest positions of the patches' centres [m]."""
        low, high = self.bounds
        centres = []
        for name, (nx, ny) in zip(SIDES, self._layout[0], strict=True):
            normal, first, second = self.axes(name)
            points = np.empty((nx * ny, 3))
            for a, n, order in (
                (first, nx, np.arange(nx * ny) // ny),
                (second, ny, np.arange(nx * ny) % ny),
            ):
                points[:, a] = low[a] + (order + 0.5) / n * (high[a] - low[a])
            points[:, normal] = (high if name[0] == "+" else low)[normal]
            centres.append(points)
        return np.concatenate(centres)

    @cached_property
    def patch_normals(self) -> FloatArray:
        """(p, 3) outward normals of the patches at rest."""
        normals = []
        for name, (nx, ny) in zip(SIDES, self._layout[0], strict=True):
            normal = np.zeros(3)
            normal["xyz".index(name[1])] = 1.0 if name[0] == "+" else -1.0
            normals.append(np.tile(normal, (nx * ny, 1)))
        return np.concatenate(normals)

    def edge_distance(self, points: FloatArray, side: IntArray) -> FloatArray:
        """Distance (m,) [m] of rest positions to the nearest edge of their side, the base
        included.
        """
        low, high = self.bounds
        inside = np.minimum(points - low, high - points)
        normal_axis = np.array(["xyz".index(name[1]) for name in SIDES])[side]
        inside[np.arange(len(points)), normal_axis] = np.inf
        x, y, z = inside.T
        return np.asarray(np.minimum(np.minimum(x, y), z))


@dataclass(frozen=True, eq=False)
class Gaps:
    """Signed distances of measured points to a simulated surface.

    Attributes:
        index: (m,) rows of the given points whose rays meet the surface.
        gap: (m,) measured minus simulated along the outward normal [m].
        foot: (m, 3) rest positions of the material points that they meet [m].
        normal: (m, 3) outward normals of the deformed surface.
        facing: (m,) cosine between the normal and the direction to the camera [1].
        patch: (m,) patch numbers.
        side: (m,) numbers in SIDES.
    """

    index: IntArray
    gap: FloatArray
    foot: FloatArray
    normal: FloatArray
    facing: FloatArray
    patch: IntArray
    side: IntArray


def gaps(
    points: FloatArray,
    camera: FloatArray,
    frame: Equilibrium,
    surface: Surface,
    *,
    everything: bool = False,
    grazing: float = GRAZING,
    lowest: float = 0.0,
) -> Gaps:
    """Compare measured points with the surface of one frame, along the camera's rays.

    Unless `everything` is set, points are left out whose ray grazes the block, passes near an edge,
    meets it too low, or ends more than 8 mm away.

    Args:
        points: (n, 3) segmented points [m], phantom frame.
        camera: (3,) optical centre [m], phantom frame.
        frame: the simulated block.
        surface: its material points.
        everything: keep all points whose ray meets the block.
        grazing: cosine between ray and normal below which a ray grazes it [1].
        lowest: height of the lowest material point that counts [m]
            (`palpate.measurement.segmentation.Cleaner.lowest`).
    """
    import open3d as o3d

    moved = frame.move(surface.vertices)
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(moved.astype(np.float32)),
        o3d.core.Tensor.from_numpy(surface.faces.astype(np.uint32)),
    )
    rays = points - camera
    rays = rays / lengths(rays)[:, None]
    lines = np.hstack([np.broadcast_to(camera, points.shape), rays]).astype(np.float32)
    cast = scene.cast_rays(o3d.core.Tensor.from_numpy(lines))
    triangle = cast["primitive_ids"].numpy().astype(np.int64)
    hit = np.flatnonzero(np.isfinite(cast["t_hit"].numpy()))
    triangle, rays = triangle[hit], rays[hit]
    u, v = cast["primitive_uvs"].numpy()[hit].T
    corners = surface.faces[triangle]
    weights = np.stack([1 - u - v, u, v], axis=1)
    foot = np.einsum("ma,mai->mi", weights, surface.vertices[corners])
    one, two, three = moved[surface.faces.T]
    across = np.cross(two - one, three - one)
    normal = across[triangle] / lengths(across)[triangle][:, None]
    # The triangles are chords of the curved surface; the gap refers to the finite elements' point.
    gap = np.einsum("mi,mi->m", points[hit] - frame.move(foot), normal)
    side = surface.side[triangle]
    facing = -np.einsum("mi,mi->m", rays, normal)
    good = (facing > grazing) & (np.abs(gap) < _OUTLIER)
    good &= surface.edge_distance(foot, side) > surface.edge
    good &= foot[:, 2] >= surface.bounds[0][2] + lowest
    good |= everything
    foot, side = foot[good], side[good]
    return Gaps(
        hit[good], gap[good], foot, normal[good], facing[good], surface.patch_of(foot, side), side
    )


def gaps_beside(
    points: FloatArray,
    camera: FloatArray,
    frame: Equilibrium,
    surface: Surface,
    foot: FloatArray,
    side: IntArray,
) -> Gaps:
    """Compare measured points with tangent planes at given material points, for rays that just miss
    the block.

    Args:
        points: (n, 3) [m], phantom frame.
        camera: (3,) optical centre [m].
        frame: the simulated block.
        surface: its material points.
        foot: (n, 3) rest positions of the material points [m].
        side: (n,) numbers in SIDES of their sides.
    """
    low, high = surface.bounds
    here, along = frame.move(foot), np.zeros((2, len(foot), 3))
    for number, name in enumerate(SIDES):
        on = side == number
        for row, axis in enumerate(surface.axes(name)[1:]):
            inwards = np.where(foot[on, axis] > (low[axis] + high[axis]) / 2, -1.0, 1.0)
            beside = foot[on].copy()
            beside[:, axis] += inwards * _BESIDE
            along[row, on] = inwards[:, None] * (frame.move(beside) - here[on])
    normal = np.cross(along[0], along[1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    rays = points - camera
    facing = -np.einsum("mi,mi->m", rays / np.linalg.norm(rays, axis=1)[:, None], normal)
    gap = np.einsum("mi,mi->m", points - here, normal)
    return Gaps(
        np.arange(len(points)), gap, foot, normal, facing, surface.patch_of(foot, side), side
    )
