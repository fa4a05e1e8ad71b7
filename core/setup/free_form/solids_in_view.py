"""Rigid things around a phantom, as the rays of a camera meet them (Embree in Open3D)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Solid

__all__ = ["distances_along"]

_KEPT = 8
_scenes: dict[tuple[int, ...], tuple[tuple[Solid, ...], Any]] = {}


def distances_along(solids: Sequence[Solid], rays: FloatArray) -> FloatArray:
    """Cast rays against rigid things.

    Args:
        solids: in the frame of the rays.
        rays: (n, 6) origins [m] and unit directions.

    Returns:
        distance (n,) [m] to the first thing; infinite where a ray meets none.
    """
    if not solids:
        return np.full(len(rays), np.inf)
    import open3d as o3d

    scene = _scene(tuple(solids))
    found = scene.cast_rays(o3d.core.Tensor.from_numpy(np.ascontiguousarray(rays, np.float32)))
    return np.asarray(found["t_hit"].numpy(), dtype=float)


def _scene(solids: tuple[Solid, ...]) -> Any:
    """Open3D's scene of the things; the last few are kept with the arrays that they are of."""
    import open3d as o3d

    key = tuple(id(vertices) for vertices, _ in solids)
    if key not in _scenes:
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        for vertices, triangles in solids:
            scene.add_triangles(
                o3d.core.Tensor.from_numpy(vertices.astype(np.float32)),
                o3d.core.Tensor.from_numpy(triangles.astype(np.uint32)),
            )
        while len(_scenes) >= _KEPT:
            _scenes.pop(next(iter(_scenes)))
        _scenes[key] = solids, scene
    return _scenes[key][1]
