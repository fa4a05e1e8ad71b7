"""Height of a closed surface above places of the table."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.setup.free_form.distance_grid import scene_of

__all__ = ["heights_above"]

_CLEAR = 1e-2
"""Height above the surface at which the rays begin [m]."""


def heights_above(
    vertices: FloatArray, triangles: IntArray, places: FloatArray, known: FloatArray
) -> FloatArray:
    """Height (m,) [m] at which a ray from above meets a surface over each of places (m, 2).

    A place beside the surface has the height over the nearest of the known points.

    Args:
        vertices: (v, 3) [m] of the surface.
        triangles: (t, 3) of the surface.
        places: (m, 2) x and y [m].
        known: (k, 3) points of the surface [m].
    """
    found = _cast(vertices, triangles, places)
    beside = np.flatnonzero(~np.isfinite(found))
    if len(beside):
        over = _cast(vertices, triangles, known[:, :2])
        met = np.isfinite(over)
        nearest = cKDTree(known[met, :2]).query(places[beside])[1]
        found[beside] = over[met][nearest]
    return found


def _cast(vertices: FloatArray, triangles: IntArray, places: FloatArray) -> FloatArray:
    """Height (m,) [m] at which vertical rays meet a surface first; infinite where they miss it."""
    import open3d as o3d

    start = float(vertices[:, 2].max()) + _CLEAR
    rays = np.zeros((len(places), 6), dtype=np.float32)
    rays[:, :2], rays[:, 2], rays[:, 5] = places, start, -1.0
    cast = scene_of(vertices, triangles).cast_rays(o3d.core.Tensor.from_numpy(rays))
    return np.asarray(start - cast["t_hit"].numpy().astype(float))
