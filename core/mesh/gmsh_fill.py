"""Tetrahedral meshes of closed surfaces by Gmsh, fine near the tool.

Gmsh (Geuzaine and Remacle 2009) is under the GPL and stays optional: `pip install
"palpate[shapes]"`. The surface's triangles only define the geometry: they are joined to patches,
between sharp edges and the border of the held region, and each patch is triangulated anew (Remacle
et al. 2010).
"""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError, SetupError
from palpate.foundation.signal_handling import signals_kept
from palpate.mesh.protocol import FINER
from palpate.mesh.tet_mesh import TetMesh, sides_of, stretched
from palpate.setup.free_form.closest_point import nearest
from palpate.setup.free_form.shape import Shape

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["TetSpec", "check_spacing", "fill"]

_SHARP = np.radians(40.0)
"""Triangles that meet at a larger angle than this keep an edge between them [rad]."""
_TETRAHEDRA, _TRIANGLES, _LINES = 4, 2, 1
"""Gmsh's numbers of element types."""
_FRONTAL, _DELAUNAY = 6, 1
"""Gmsh's numbers of meshing algorithms in the plane and in space."""
_alone = threading.Lock()


def check_spacing(spacing: float, coarsest: float) -> None:
    """Raise MeshError unless 0 < spacing <= coarsest < 1 m.

    Args:
        spacing: of the nodes near the tool [m].
        coarsest: of the nodes far from it [m].
    """
    if not 0 < spacing <= coarsest < 1:
        raise MeshError(
            f"spacing {spacing:g} m and coarsest {coarsest:g} m are not in this order "
            "between 0 and 1 m",
            spacing=spacing,
            coarsest=coarsest,
        )


@dataclass(frozen=True, kw_only=True)
class TetSpec:
    """Mesh of a shape: one mesh for a whole motion, fine wherever the tool goes.

    Attributes:
        path: positions of the tool's centre [m], phantom frame.
        radius: distance from the touched_places places within which the mesh is finest [m].
        spacing: of the nodes there [m], half an edge.
        growth: increase of an edge's length per distance from there [1].
        coarsest: spacing far away [m].
    """

    path: tuple[tuple[float, float, float], ...]
    radius: float
    spacing: float = 1.5e-3
    growth: float = 0.4
    coarsest: float = 4e-3

    def __post_init__(self) -> None:
        check_spacing(self.spacing, self.coarsest)
        if not 0 < self.growth <= 2:
            raise MeshError(f"growth {self.growth:g} is not between 0 and 2", growth=self.growth)

    @classmethod
    def along(cls, centres: FloatArray, radius: float, **spacings: float) -> TetSpec:
        """Make the specification for a motion (f, 3) [m] of a tool of this radius [m].

        Positions closer together than the nodes are taken once.
        """
        spec = cls(path=(), radius=radius, **spacings)
        places = np.unique(np.round(centres / spec.spacing), axis=0) * spec.spacing
        return cls(
            path=tuple((float(x), float(y), float(z)) for x, y, z in places),
            radius=radius,
            **spacings,
        )

    def mesh(self, setup: Setup, centre: FloatArray) -> TetMesh:
        """The mesh, the same for all positions of the tool's centre."""
        made = fill(setup.stated_shape, self)
        return made if setup.registered is None else stretched(made, setup.factors)

    def finer(self) -> TetSpec:
        """The same with nodes FINER times closer."""
        return replace(self, spacing=self.spacing / FINER, coarsest=self.coarsest / FINER)


def touched_places(shape: Shape, spec: TetSpec) -> FloatArray:
    """Points of the surface (k, 3) [m] that the tool comes near, about a spacing or more apart."""
    path = np.array(spec.path).reshape(-1, 3)
    if not len(path):
        return path
    places = shape.nearest(path)
    near = np.linalg.norm(places - path, axis=1) <= 1.2 * spec.radius + spec.spacing
    _, places = nearest(path[near], shape.corners)
    _, first = np.unique(np.round(places / spec.spacing), axis=0, return_index=True)
    return np.asarray(places[np.sort(first)])


@lru_cache(maxsize=8)
def fill(shape: Shape, spec: TetSpec) -> TetMesh:
    """Fill a shape with tetrahedra; the same input gives the same mesh."""
    with _gmsh() as gmsh:
        try:
            _build(gmsh, shape)
            _size(gmsh, touched_places(shape, spec), spec)
            gmsh.model.mesh.generate(3)
            corners, tetrahedra = _read_mesh(gmsh)
        except Exception as error:  # Gmsh raises plain exceptions
            raise MeshError(
                f"{shape.name}: Gmsh found no tetrahedra within the surface ({error}); repair or "
                "smooth it, or use a spacing "
                f"smaller than {spec.spacing:g} m",
                file=shape.name,
            ) from error
    return _checked_mesh(shape, spec, corners, tetrahedra)


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
            "libxinerama1",
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


def _size(gmsh: Any, places: FloatArray, spec: TetSpec) -> None:
    """Set edges of twice the spacing around these points (k, 3) [m], growing with the distance from
    them.
    """
    field, finest, coarsest = gmsh.model.mesh.field, 2 * spec.spacing, 2 * spec.coarsest
    balls = []
    for place in places:
        ball = field.add("Ball")
        values = {
            "Radius": spec.radius,
            "VIn": finest,
            "VOut": coarsest,
            "Thickness": (coarsest - finest) / spec.growth,
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
    gmsh.option.setNumber("Mesh.MeshSizeMax", coarsest)
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


def _checked_mesh(
    shape: Shape, spec: TetSpec, corners: FloatArray, tetrahedra: IntArray
) -> TetMesh:
    """Make the mesh if it fills the surface; a side is held if the surface next to it is."""
    edges = corners[tetrahedra[:, 1:]] - corners[tetrahedra[:, :1]]
    volumes = np.linalg.det(edges) / 6
    if not len(volumes) or volumes.min() <= 0 or abs(volumes.sum() / shape.volume - 1) > 0.05:
        raise MeshError(
            f"{shape.name}: the {len(volumes)} tetrahedra hold {1e6 * volumes.sum():.4g} cm3 of "
            "the surface's "
            f"{1e6 * shape.volume:.4g} cm3; use a smaller coarsest spacing than {spec.coarsest:g} "
            "m",
            file=shape.name,
            volume=float(volumes.sum()),
            expected=shape.volume,
        )
    middles = corners[sides_of(tetrahedra)].mean(axis=1)
    held = shape.held[nearest(middles, shape.corners)[0]]
    if not held.any() or held.all():
        raise MeshError(
            f"{shape.name}: {held.sum()} of the mesh's {len(held)} sides are held; use a smaller "
            "coarsest spacing than "
            f"{spec.coarsest:g} m, so that the fixed region has some of its own",
            file=shape.name,
            held=int(held.sum()),
        )
    return TetMesh(corners, tetrahedra, held)
