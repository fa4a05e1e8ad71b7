"""Size and quality of a mesh of tetrahedra, and the time that it takes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.tet_mesh import TetMesh

__all__ = ["POOR_QUALITY", "MeshQuality", "measured_mesh", "tetrahedron_qualities"]

POOR_QUALITY = 0.05
"""Quality of the worst tetrahedron below which a warning is given [1]; chosen, not derived: Gmsh
and Netgen stay above 0.08 on most of the virtual bench's shapes."""


@dataclass(frozen=True)
class MeshQuality:
    """Size and quality of a mesh.

    Attributes:
        nodes: number.
        tetrahedra: number.
        least: quality of the worst tetrahedron [1], see `tetrahedron_qualities`.
        typical: median quality [1].
        seconds: time of meshing [s].
    """

    nodes: int
    tetrahedra: int
    least: float
    typical: float
    seconds: float


def measured_mesh(make: Callable[[], TetMesh]) -> MeshQuality:
    """Make a mesh and measure it."""
    began = time.perf_counter()
    mesh = make()
    seconds = time.perf_counter() - began
    qualities = tetrahedron_qualities(mesh.corners, mesh.tetrahedra)
    return MeshQuality(
        nodes=len(mesh.nodes),
        tetrahedra=len(mesh.tetrahedra),
        least=float(qualities.min()),
        typical=float(np.median(qualities)),
        seconds=seconds,
    )


def tetrahedron_qualities(corners: FloatArray, tetrahedra: IntArray) -> FloatArray:
    """Volumes of tetrahedra over those of regular ones with their mean square edge (e,) [1]:
    1 for regular ones, 0 for flat ones.

    Source: Parthasarathy, Graichen and Hathaway, A comparison of tetrahedron quality measures,
    1994.

    Args:
        corners: (c, 3) [m].
        tetrahedra: (e, 4).
    """
    places = corners[tetrahedra]
    volumes = np.linalg.det(places[:, 1:] - places[:, :1]) / 6
    edges = places[:, :, None] - places[:, None]
    square = (edges**2).sum(axis=(1, 2, 3)) / 12
    return np.asarray(6 * np.sqrt(2) * volumes / square**1.5)
