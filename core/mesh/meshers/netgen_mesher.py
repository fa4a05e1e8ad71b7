"""Tetrahedra by Netgen (Schoeberl 1997), which is under the LGPL and installed with Palpate."""

from __future__ import annotations

import tempfile
import threading
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import SetupError
from palpate.foundation.signal_handling import signals_kept
from palpate.mesh.meshers.size_field import SizeField
from palpate.setup.free_form.shape import Shape

__all__ = ["NetgenMesher"]

_MILLIMETRES = 1e3
"""Netgen's absolute tolerances are made for bodies of about this many units [1/m]."""
_SHORTER, _SHORTER_FAR = 0.7, 0.85
"""Ratios of the length that is asked for and the wanted one, near the points and far from them,
measured on six families of shapes: Netgen's edges come out longer [1]."""
_STEP = 0.4
"""Distance of the points at which the length is prescribed over the length [1]."""
_alone = threading.Lock()


@dataclass(frozen=True)
class NetgenMesher:
    """Triangulates the surface anew between its sharp edges, and fills it.

    The border of a held region is kept where it is a sharp edge; elsewhere the mesh follows it to
    within half an edge.
    """

    name = "Netgen"
    package = "netgen-mesher"

    @property
    def is_there(self) -> bool:
        """Whether it is installed."""
        return find_spec("netgen") is not None

    def tetrahedra(self, shape: Shape, size: SizeField) -> tuple[FloatArray, IntArray]:
        """Fill a shape, see `TetMesher`."""
        try:
            from netgen.meshing import MeshingParameters
            from netgen.stl import STLGeometry
        except (ImportError, OSError) as error:
            raise SetupError(
                f"shapes other than a block are meshed by Netgen, which is not there ({error}): "
                "pip install netgen-mesher",
                key="geometry",
            ) from error
        with _alone, signals_kept(), tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "surface.stl"
            _write(file, _MILLIMETRES * shape.corners)
            asked = MeshingParameters(
                maxh=_MILLIMETRES * _SHORTER_FAR * size.coarsest, grading=size.growth
            )
            length = _SHORTER * size.finest
            for point in _MILLIMETRES * _within(size, _STEP * length):
                asked.RestrictH(*(float(value) for value in point), _MILLIMETRES * length)
            # Without this the prescribed lengths are forgotten after the surface is meshed.
            mesh = STLGeometry(str(file)).GenerateMesh(mp=asked, recalc_h_opt=False)
            places = np.array([point.p for point in mesh.Points()]).reshape(-1, 3)
            numbers = np.array(
                [[vertex.nr for vertex in element.vertices] for element in mesh.Elements3D()],
                dtype=np.int64,
            ).reshape(-1, 4)
        used, tetrahedra = np.unique(numbers - 1, return_inverse=True)
        corners, tetrahedra = places[used] / _MILLIMETRES, tetrahedra.reshape(-1, 4)
        edges = corners[tetrahedra[:, 1:]] - corners[tetrahedra[:, :1]]
        inverted = np.linalg.det(edges) < 0
        tetrahedra[inverted] = tetrahedra[inverted][:, [0, 2, 1, 3]]
        return corners, tetrahedra


def _within(size: SizeField, step: float) -> FloatArray:
    """Points (m, 3) [m] of grids of a step [m] in the balls where edges are shortest."""
    axis = np.arange(-np.ceil(size.radius / step), np.ceil(size.radius / step) + 1) * step
    grid = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    ball = grid[np.linalg.norm(grid, axis=1) <= size.radius]
    return np.asarray((size.places[:, None] + ball).reshape(-1, 3))


def _write(file: Path, corners: FloatArray) -> None:
    """Write triangles (t, 3, 3) as ASCII STL, in which no digit is lost."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    lines = ["solid body"]
    for normal, triangle in zip(normals.tolist(), corners.tolist(), strict=True):
        lines.append("facet normal {!r} {!r} {!r}\nouter loop".format(*normal))
        lines += ["vertex {!r} {!r} {!r}".format(*corner) for corner in triangle]
        lines.append("endloop\nendfacet")
    file.write_text("\n".join([*lines, "endsolid body"]) + "\n")
