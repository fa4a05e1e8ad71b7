"""The paper's error metric: one-directional mean distance to a super-sampled surface."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.replay.replay import Equilibrium
from palpate.setup.phantom_geometry import Surface

__all__ = ["PAPER_GRID", "paper_distance", "supersampled"]

PAPER_GRID = GridSpec(nodes=(13, 5, 5))
"""The paper's grid (Wu, Kazanzides and Unberath 2020)."""
_FOLD = 3
"""Super-sampling along each axis."""


@lru_cache(maxsize=8)
def _dense(size: tuple[float, float, float]) -> FloatArray:
    """Rest positions of the paper grid's free surface, super-sampled three-fold along each axis (v,
    3) [m].
    """
    nodes = (_FOLD * (n - 1) + 1 for n in PAPER_GRID.nodes)
    nx, ny, nz = nodes
    mesh = box_mesh(size, GridSpec(nodes=(nx, ny, nz)))
    return mesh.nodes[np.unique(mesh.free_surface)]


def supersampled(frame: Equilibrium, surface: Surface) -> FloatArray:
    """Vertices (v, 3) [m] of the 13x5x5 grid's free surface, super-sampled three-fold by linear
    interpolation; of a body that is no block, the vertices of its surface.

    The paper's grid is a sampling of the mesh that is solved.
    """
    if not surface.geometry.is_block:
        return frame.move(surface.vertices)
    size = surface.geometry.size
    coarse = box_mesh(size, PAPER_GRID)
    displacement = frame.move(coarse.nodes) - coarse.nodes
    dense = _dense(size)
    return dense + coarse.interpolate(displacement, dense)


def paper_distance(points: FloatArray, frame: Equilibrium, surface: Surface) -> float:
    """Mean distance [m] of measured points (n, 3) to the nearest super-sampled vertex (Wu,
    Kazanzides and Unberath 2020).
    """
    if not len(points):
        return float("nan")
    distance, _ = cKDTree(supersampled(frame, surface)).query(points)
    return float(np.mean(distance))
