"""Tetrahedral meshes of closed surfaces, fine near the tool, by whichever mesher is chosen.

The surface's triangles only define the geometry: it is triangulated anew between its sharp edges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError, SetupError
from palpate.mesh.cast_mesh import as_built
from palpate.mesh.meshers.mesh_cache import cached_tetrahedra
from palpate.mesh.meshers.mesher_choice import SizeField, TetMesher, chosen_mesher
from palpate.mesh.protocol import FINER
from palpate.mesh.tet_mesh import TetMesh, sides_of
from palpate.setup.free_form.closest_point import nearest
from palpate.setup.free_form.shape import Shape

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["TetSpec", "check_spacing", "fill", "touched_places"]


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
        return as_built(fill(setup.stated_shape, self), setup)

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


def fill(shape: Shape, spec: TetSpec) -> TetMesh:
    """Fill a shape with tetrahedra; the same input gives the same mesh."""
    return _filled(shape, spec, chosen_mesher())


@lru_cache(maxsize=8)
def _filled(shape: Shape, spec: TetSpec, mesher: TetMesher) -> TetMesh:
    size = SizeField(
        places=touched_places(shape, spec),
        radius=spec.radius,
        finest=2 * spec.spacing,
        coarsest=2 * spec.coarsest,
        growth=spec.growth,
    )
    try:
        corners, tetrahedra = cached_tetrahedra(shape, size, mesher)
    except SetupError:
        raise
    except Exception as error:  # meshers raise plain exceptions
        raise MeshError(
            f"{shape.name}: {mesher.name} found no tetrahedra within the surface ({error}); repair "
            f"or smooth it, or use a spacing smaller than {spec.spacing:g} m",
            file=shape.name,
        ) from error
    return _checked_mesh(shape, spec, corners, tetrahedra)


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
