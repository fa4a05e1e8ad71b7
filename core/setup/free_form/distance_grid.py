"""Signed distance to a closed surface on a grid, for the many points of a cloud."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from scipy.ndimage import map_coordinates

from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["DistanceGrid", "scene_of"]

_MARGIN = 0.02
"""How far the grid reaches beyond the surface [m]."""
_CELLS = 60
"""Cells along the surface's longest side."""
_FINEST = 1.0e-3
"""Least size of a cell [m]."""


@dataclass(frozen=True, eq=False)
class DistanceGrid:
    """Distances at the corners of a grid, between which they are interpolated.

    Farther away than the grid reaches, the distance from the grid is added.

    Attributes:
        low: lowest corner (3,) [m].
        step: size of a cell [m].
        values: (a, b, c) signed distances [m], positive outside.
    """

    low: FloatArray
    step: float
    values: FloatArray

    @classmethod
    def of(cls, vertices: FloatArray, triangles: IntArray, part: IntArray | None = None) -> Self:
        """Measure a closed surface of vertices (v, 3) [m] and outward triangles (t, 3).

        Args:
            vertices: of the surface.
            triangles: of the surface, which say what is inside.
            part: (p, 3) triangles to which distances are measured; all of them without it.
        """
        import open3d as o3d

        low, high = vertices.min(axis=0) - _MARGIN, vertices.max(axis=0) + _MARGIN
        step = max(float(np.ptp(vertices, axis=0).max()) / _CELLS, _FINEST)
        axes = [np.arange(a, b + step, step) for a, b in zip(low, high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).astype(np.float32)
        corners = o3d.core.Tensor.from_numpy(grid)
        distances = np.asarray(
            scene_of(vertices, triangles).compute_signed_distance(corners).numpy(), dtype=float
        )
        if part is not None:
            apart = scene_of(vertices, part).compute_distance(corners).numpy()
            distances = np.where(distances < 0, -apart, apart)
        return cls(low, step, distances)

    def __call__(self, points: FloatArray) -> FloatArray:
        """Signed distances (m,) [m] of points (m, 3) [m]."""
        places = (points - self.low) / self.step
        inside = np.clip(places, 0.0, np.array(self.values.shape) - 1.0)
        near = map_coordinates(self.values, inside.T, order=1)
        return np.asarray(near + self.step * np.linalg.norm(places - inside, axis=1))


def scene_of(vertices: FloatArray, triangles: IntArray) -> Any:
    """Open3D's scene of a surface of vertices (v, 3) [m] and triangles (t, 3)."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(vertices.astype(np.float32)),
        o3d.core.Tensor.from_numpy(triangles.astype(np.uint32)),
    )
    return scene
