"""An organ of the virtual bench: a smooth, lobed dome on a flat base.

A formula gives the distance of the surface from the middle of the base in every direction. The
experimenter is given a triangulation of it. The body that is pressed is another, finer mesh with
curved elements along the formula.
"""

from __future__ import annotations

import logging
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.tet_fill import TetSpec, fill
from palpate.setup.setup import Shape
from palpate.synthetic.solver.tet_block import (
    TetBlock,
    TetGrading,
    refine_mesh,
    tet_block_from_mesh,
)

__all__ = ["AXES", "organ_block", "organ_normals", "organ_places", "organ_surface", "write_surface"]

AXES = (0.036, 0.027, 0.030)
"""Semi-axes of the ellipsoid to which the lobes are added [m]."""
_LOBES = ((2, 0.05, 0.4), (3, 0.045, 1.9), (1, 0.04, -0.8))
"""Number of waves around, amplitude at the base over the radius [1], and phase [rad]. The lobes
fade towards the top."""
_HOLLOW = 0.07
"""Depth of a shallow groove across the top over the radius [1]."""
_COARSE = 2.5e-3
"""Edge length of the surface that is handed out [m]."""


def organ_places(directions: FloatArray) -> FloatArray:
    """Points of the surface (n, 3) [m] in directions (n, 3) from the middle of the base, upwards or
    level.
    """
    unit = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    turn, rise = np.arctan2(unit[:, 1], unit[:, 0]), np.clip(unit[:, 2], 0.0, 1.0)
    radius = 1.0 / np.linalg.norm(unit / np.array(AXES), axis=1)
    lobes = sum(share * np.cos(waves * turn + phase) for waves, share, phase in _LOBES)
    groove = _HOLLOW * np.exp(-((unit[:, 0] / 0.35) ** 2)) * rise**3
    return np.asarray(unit * (radius * (1.0 + (1.0 - rise**2) * lobes - groove))[:, None])


def organ_normals(places: FloatArray) -> FloatArray:
    """Outward unit normals (n, 3) at points (n, 3) [m] of the surface."""
    unit = places / np.linalg.norm(places, axis=1, keepdims=True)
    first = np.cross(
        unit, np.where(np.abs(unit[:, 2:]) < 0.9, [[0.0, 0.0, 1.0]], [[1.0, 0.0, 0.0]])
    )
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second, step = np.cross(unit, first), 1e-4
    along, across = (
        organ_places(unit + step * way) - organ_places(unit - step * way) for way in (first, second)
    )
    normal = np.cross(along, across)
    normal *= np.sign(np.einsum("ni,ni->n", normal, unit))[:, None]
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def organ_surface(edge: float = _COARSE) -> tuple[FloatArray, IntArray]:
    """Vertices (v, 3) [m] and outward triangles (t, 3) of about this edge length [m], closed by the
    flat base.
    """
    rings = max(6, round(np.pi / 2 * AXES[2] / edge))
    counts = [
        max(6, round(2 * np.pi * AXES[0] * np.cos(up) / edge))
        for up in np.linspace(0, np.pi / 2, rings + 1)[:-1]
    ]
    rows = [
        _ring(up, count)
        for up, count in zip(np.linspace(0, np.pi / 2, rings + 1)[:-1], counts, strict=True)
    ]
    top = organ_places(np.array([[0.0, 0.0, 1.0]]))
    inner = [share * rows[0][:: max(1, round(1 / share))] for share in (0.75, 0.5, 0.25)]
    vertices = np.concatenate([*rows, top, *inner, np.zeros((1, 3))])
    starts = np.cumsum([0, *(len(row) for row in rows), 1, *(len(row) for row in inner)])
    numbers = [
        np.arange(low, high)
        for low, high in zip(starts, [*starts[1:], starts[-1] + 1], strict=True)
    ]
    triangles = _strips(vertices, numbers[: rings + 1])
    base = _strips(vertices, [numbers[0], *numbers[rings + 1 :]])
    return vertices, np.concatenate([triangles, base[:, ::-1]])


def _ring(up: float, count: int) -> FloatArray:
    turn = 2 * np.pi * np.arange(count) / count
    flat = np.cos(up) * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    return organ_places(np.column_stack([flat, np.full(count, np.sin(up))]))


def _strips(vertices: FloatArray, rings: list[IntArray]) -> IntArray:
    """Triangles (t, 3) between neighbouring rings of vertices, of which the last is one point."""
    triangles = []
    for lower, upper in pairwise(rings):
        here = there = 0
        ends = (len(lower), len(upper) if len(upper) > 1 else 0)
        while here < ends[0] or there < ends[1]:
            a, b = lower[here % len(lower)], upper[there % len(upper)]
            if there >= ends[1] or (
                here < ends[0] and (here + 0.5) / ends[0] <= (there + 0.5) / ends[1]
            ):
                here += 1
                triangles.append((a, lower[here % len(lower)], b))
            else:
                there += 1
                triangles.append((a, upper[there % len(upper)], b))
    return np.array(triangles, dtype=np.int64)


def write_surface(path: Path, vertices: FloatArray, triangles: IntArray) -> None:
    """Write a binary STL, metres."""
    corners = vertices[triangles].astype("<f4")
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    record = np.zeros(
        len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")]
    )
    record["normal"], record["corners"] = normals, corners
    path.write_bytes(
        b"virtual organ, metres".ljust(80)
        + np.uint32(len(triangles)).astype("<u4").tobytes()
        + record.tobytes()
    )


def organ_block(
    places: FloatArray, reach: float, fine: float, within: TetGrading | None = None
) -> TetBlock:
    """Mesh the body with quadratic tetrahedra that are curved along the formula.

    Args:
        places: (k, 3) points near which the mesh is fine [m].
        reach: distance up to which it is fine [m].
        fine: edge length there [m].
        within: further refinement inside, for a lump; None without.
    """
    from skfem import MeshTet2

    logging.getLogger("skfem").setLevel(logging.ERROR)
    near = tuple((float(x), float(y), float(z)) for x, y, z in places)
    spec = TetSpec(path=near, radius=reach, spacing=fine / 2, growth=0.5, coarsest=4e-3)
    solid = fill(Shape(*organ_surface(1.6e-3), name="organ"), spec)
    tetrahedra = _linear(solid.corners, solid.tetrahedra)
    bent = _bent(
        MeshTet2.from_mesh(tetrahedra if within is None else refine_mesh(tetrahedra, within))
    )
    return tet_block_from_mesh(bent, _mapped(bent))


def _mapped(mesh: Any) -> Any:
    """The mesh's isoparametric mapping with a tolerance that slender tetrahedra can reach."""
    from skfem.mapping import MappingIsoparametric

    mapping = MappingIsoparametric(mesh, mesh.elem(), mesh.bndelem)
    mapping.invF = partial(mapping.invF, newton_tol=1e-9)
    return mapping


def _linear(corners: FloatArray, tetrahedra: IntArray) -> Any:
    from skfem import MeshTet

    return MeshTet(np.ascontiguousarray(corners.T), np.ascontiguousarray(tetrahedra.T))


def _bent(mesh: Any) -> Any:
    """Move all nodes of the free surface onto the formula."""
    from skfem import Basis, ElementTetP2

    basis = Basis(mesh, ElementTetP2())
    places = np.array(mesh.doflocs)
    base = mesh.facets_satisfying(lambda x: x[2] < 1e-9, boundaries_only=True)
    held = basis.get_dofs(base).all()
    skin = np.setdiff1d(basis.get_dofs(np.setdiff1d(mesh.boundary_facets(), base)).all(), held)
    outer = basis.doflocs[:, skin].T
    order = _same_places(places, basis.doflocs[:, skin])
    places[:, order] = organ_places(outer).T
    return type(mesh)(places, mesh.t)


def _same_places(places: FloatArray, targets: FloatArray) -> IntArray:
    """Columns of `places` (3, n) that coincide with `targets` (3, k)."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(places.T).query(targets.T)[1])
