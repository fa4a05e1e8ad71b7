"""Tetrahedra by Gmsh (Geuzaine and Remacle 2009), which is under the GPL and stays optional."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import SetupError
from palpate.foundation.signal_handling import signals_kept
from palpate.mesh.meshers.size_field import SizeField
from palpate.setup.free_form.shape import Shape

__all__ = ["GmshMesher"]

_SHARP = np.radians(40.0)
"""Triangles that meet at a larger angle than this keep an edge between them [rad]."""
_TETRAHEDRA, _TRIANGLES, _LINES = 4, 2, 1
"""Gmsh's numbers of element types."""
_FRONTAL, _DELAUNAY = 6, 1
"""Gmsh's numbers of meshing algorithms in the plane and in space."""
_alone = threading.Lock()


@dataclass(frozen=True)
class GmshMesher:
    """Joins the surface's triangles to patches, between sharp edges and the border of the held
    region, and triangulates each patch anew (Remacle et al. 2010).
    """

    name = "Gmsh"
    package = "gmsh"

    @property
    def is_there(self) -> bool:
        """Whether it is installed."""
        return find_spec("gmsh") is not None

    def tetrahedra(self, shape: Shape, size: SizeField) -> tuple[FloatArray, IntArray]:
        """Fill a shape, see `TetMesher`."""
        with _gmsh() as gmsh:
            _build(gmsh, shape)
            _size(gmsh, size)
            gmsh.model.mesh.generate(3)
            return _read_mesh(gmsh)


@contextmanager
def _gmsh() -> Iterator[Any]:
    """Gmsh with an empty model, for one thread at a time.

    It changes no signal handling and reads none of the user's files.
    """
    try:
        import gmsh
    except (ImportError, OSError) as error:
        raise SetupError(
            f"shapes other than a block are meshed by Gmsh, which is not there ({error}): "
            'pip install "palpate[shapes]"; on Debian '
            "and Ubuntu also apt-get install libglu1-mesa libxrender1 libxcursor1 libxft2 "
            "libxinerama1; or take Netgen with PALPATE_MESHER=netgen",
            key="geometry",
        ) from error
    with _alone, signals_kept():
        gmsh.initialize([], readConfigFiles=False, run=False, interruptible=False)
        try:
            for key, value in {
                "General.Terminal": 0,
                "General.NumThreads": 1,
                "General.AbortOnError": 2,
            }.items():
                gmsh.option.setNumber(key, value)
            gmsh.model.add("body")
            yield gmsh
        finally:
            gmsh.finalize()


def _build(gmsh: Any, shape: Shape) -> None:
    """Pass the surface to Gmsh as one volume's boundary."""
    gmsh.model.addDiscreteEntity(2, 1)
    gmsh.model.mesh.addNodes(2, 1, np.arange(1, len(shape.vertices) + 1), shape.vertices.ravel())
    gmsh.model.mesh.addElementsByType(1, _TRIANGLES, [], (shape.triangles + 1).ravel())
    gmsh.model.addDiscreteEntity(1, 1)
    gmsh.model.mesh.addElementsByType(1, _LINES, [], (_border(shape) + 1).ravel())
    gmsh.model.mesh.classifySurfaces(_SHARP, True, True, np.pi)
    gmsh.model.mesh.createGeometry()
    patches = [tag for _, tag in gmsh.model.getEntities(2)]
    gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(patches)])
    gmsh.model.geo.synchronize()


def _border(shape: Shape) -> IntArray:
    """Edges (k, 2) between held and free triangles; Gmsh keeps lines that exist before it makes
    patches.
    """
    edges = np.sort(
        np.concatenate(
            [shape.triangles[:, [0, 1]], shape.triangles[:, [1, 2]], shape.triangles[:, [2, 0]]]
        ),
        axis=1,
    )
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    return np.asarray(unique[np.bincount(number.ravel(), weights=np.tile(shape.held, 3)) == 1])


def _size(gmsh: Any, size: SizeField) -> None:
    """Set the length of the edges."""
    field, balls = gmsh.model.mesh.field, []
    for place in size.places:
        ball = field.add("Ball")
        values = {
            "Radius": size.radius,
            "VIn": size.finest,
            "VOut": size.coarsest,
            "Thickness": (size.coarsest - size.finest) / size.growth,
        }
        for key, value in (
            *zip(("XCenter", "YCenter", "ZCenter"), place, strict=True),
            *values.items(),
        ):
            field.setNumber(ball, key, value)
        balls.append(ball)
    if balls:
        smallest = field.add("Min")
        field.setNumbers(smallest, "FieldsList", balls)
        field.setAsBackgroundMesh(smallest)
    for source in ("ExtendFromBoundary", "FromPoints", "FromCurvature"):
        gmsh.option.setNumber(f"Mesh.MeshSize{source}", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size.coarsest)
    gmsh.option.setNumber("Mesh.Algorithm", _FRONTAL)
    gmsh.option.setNumber("Mesh.Algorithm3D", _DELAUNAY)


def _read_mesh(gmsh: Any) -> tuple[FloatArray, IntArray]:
    """Read corners (c, 3) [m] and tetrahedra (e, 4) from Gmsh, in its order."""
    tags, places, _ = gmsh.model.mesh.getNodes()
    _, corners = gmsh.model.mesh.getElementsByType(_TETRAHEDRA)
    used, tetrahedra = np.unique(corners, return_inverse=True)
    order = np.argsort(tags)
    return places.reshape(-1, 3)[
        order[np.searchsorted(tags, used, sorter=order)]
    ], tetrahedra.reshape(-1, 4).astype(np.int64)
