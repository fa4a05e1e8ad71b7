"""Signed distances of measured points to a simulated surface, along camera rays.

The error of a depth camera is along the ray. The simulated point of a measured one is therefore the
intersection of its ray with the surface, not the nearest point: nearest points follow the noise and
turn it into bias on curved or slanted parts. The distance is taken along the surface normal. 45 000
noisy points become a few hundred averages over patches of the rest surface, which move with the
material.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray, lengths
from palpate.replay.replay import Equilibrium
from palpate.setup.phantom_geometry import Surface

__all__ = ["Gaps", "gaps", "gaps_beside"]

GRAZING = 0.3
"""Least cosine between ray and normal [1]; below it, depth noise moves points along the surface."""
_OUTLIER = 8e-3
"""Distance beyond which a point is an outlier [m]."""
_BESIDE = 1e-3
"""Distance of the material points that span a tangent plane [m]."""


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
        side: (m,) numbers of the sides.
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
    good &= foot[:, 2] >= surface.geometry.low[2] + lowest
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
        side: (n,) numbers of their sides.
    """
    here, tangents = frame.move(foot), surface.tangents(foot, side)
    along = [frame.move(foot + _BESIDE * way) - here for way in tangents]
    normal = np.cross(along[0], along[1])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    rays = points - camera
    facing = -np.einsum("mi,mi->m", rays / np.linalg.norm(rays, axis=1)[:, None], normal)
    gap = np.einsum("mi,mi->m", points - here, normal)
    return Gaps(
        np.arange(len(points)), gap, foot, normal, facing, surface.patch_of(foot, side), side
    )
