"""Meshes of a free form for the virtual bench's solver."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.tet_fill import TetSpec, fill
from palpate.setup.free_form.closest_point import nearest
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.bench.motion_plan import PlannedPush
from palpate.synthetic.bench.true_body import base_seams
from palpate.synthetic.laws.stiffness_fields import points_along
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.tet_block import (
    TetBlock,
    TetGrading,
    refine_mesh,
    tet_block_from_mesh,
)

__all__ = ["ShapeMesher", "lump_grading"]

_COARSEST = 3.5e-3
"""Spacing of nodes far from the tool [m]."""


@dataclass(frozen=True, eq=False)
class ShapeMesher:
    """Meshes a body for some of its pushes, finer than a replay does.

    The camera sees the body's own surface, which moves with the mesh.

    Attributes:
        shape: the true body.
    """

    shape: Shape

    def __call__(self, scenario: Scenario, pushes: Sequence[PlannedPush], fine: float) -> TetBlock:
        """Mesh with edges of `fine` [m] where the tool is deepest, and small ones in a lump."""
        from skfem import MeshTet

        logging.getLogger("skfem").setLevel(logging.ERROR)
        places = np.array([push.waypoints[-1] for push in pushes]).reshape(-1, 3)
        spec = TetSpec(
            path=tuple((float(x), float(y), float(z)) for x, y, z in places),
            radius=0.8 * scenario.tool_radius,
            spacing=fine / 2,
            growth=0.5,
            coarsest=max(_COARSEST, fine / 2),
        )
        solid = fill(self.shape, spec)
        mesh = MeshTet(
            np.ascontiguousarray(solid.corners.T), np.ascontiguousarray(solid.tetrahedra.T)
        )
        within = lump_grading(scenario, self.shape.low, self.shape.high)
        block = tet_block_from_mesh(mesh if within is None else refine_mesh(mesh, within))
        return self._drawn(block)

    def _drawn(self, block: TetBlock) -> TetBlock:
        """The same with the body's own surface in place of the mesh's."""
        surface = self.shape.surface()
        rows, shares = _on_triangles(surface.vertices, block.surface_rest, block.surface_faces)
        count = len(surface.vertices)
        onto = sparse.csr_matrix(
            (shares.ravel(), (np.repeat(np.arange(count), 3), rows.ravel())),
            shape=(count, len(block.surface_rest)),
        )
        return replace(
            block,
            surface=onto @ block.surface,
            surface_rest=surface.vertices,
            surface_normals=_vertex_normals(surface.vertices, surface.faces),
            surface_faces=surface.faces.astype(np.int64),
            below_skin=self.shape.below_skin(block.places.reshape(-1, 3)).reshape(
                block.weights.shape
            ),
        )


def _on_triangles(points: FloatArray, vertices: FloatArray, faces: IntArray) -> tuple[Any, Any]:
    """Corners (m, 3) and their shares (m, 3) of the triangles nearest to points (m, 3) [m]."""
    number, places = nearest(points, vertices[faces])
    a, b, c = vertices[faces[number].T]
    across = np.cross(b - a, c - a)
    parts = [np.cross(c - b, places - b), np.cross(a - c, places - c), np.cross(b - a, places - a)]
    shares = np.stack([np.einsum("mi,mi->m", part, across) for part in parts], axis=1)
    shares = np.clip(shares / np.einsum("mi,mi->m", across, across)[:, None], 0.0, 1.0)
    return faces[number], shares / shares.sum(axis=1, keepdims=True)


def _vertex_normals(vertices: FloatArray, faces: IntArray) -> FloatArray:
    """Outward unit normals (v, 3) at the vertices."""
    a, b, c = vertices[faces.T]
    across, total = np.cross(b - a, c - a), np.zeros_like(vertices)
    for corner in range(3):
        np.add.at(total, faces[:, corner], across)
    return np.asarray(total / np.linalg.norm(total, axis=1, keepdims=True))


def lump_grading(scenario: Scenario, low: FloatArray, high: FloatArray) -> TetGrading | None:
    """Edges small enough for a hidden lump or tube, and for the edge of a detached strip of the
    base; None without any.

    Args:
        scenario: that hides it.
        low: lowest corner (3,) of the body's bounding box [m].
        high: highest corner (3,) [m].
    """
    lump, tube = (scenario.hidden(name) for name in ("stiff_inclusion", "stiff_tube"))
    parts = []
    if lump is not None:
        radius = lump.value("radius")
        parts.append((np.array([[lump.value(axis) for axis in "xyz"]]), radius, 0.55 * radius))
    if tube is not None:
        radius = tube.value("radius")
        parts.append((points_along(tube, low, high), radius, radius))
    seams = base_seams(scenario, low, high)
    if not parts and not seams:
        return None
    reach, edges = (
        np.concatenate([np.zeros(0), *(np.full(len(part[0]), part[n]) for part in parts)])
        for n in (1, 2)
    )
    return TetGrading(
        np.concatenate([np.zeros((0, 3)), *(part[0] for part in parts)]),
        1.1 * reach,
        edges,
        coarse=1.0,
        growth=3.0,
        seams=seams,
    )
