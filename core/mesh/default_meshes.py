"""The mesh that each use takes where nobody asks for another, for a phantom of any shape."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import BoxMesh, GridSpec, block_size
from palpate.mesh.graded_mesh import FINE_GRID, PAGE_GRID, REPLAY_GRID, SCREEN_GRID, Grading
from palpate.mesh.grid_axes import even_axis
from palpate.mesh.protocol import Mesh, Meshing
from palpate.mesh.push_meshes import FINE_PUSHES, REPLAY_PUSHES, SCREEN_PUSHES, PushMeshSpec
from palpate.mesh.tet_fill import TetSpec
from palpate.setup.phantom_geometry import CLEARANCE, Geometry

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = [
    "Use",
    "default_mesh",
    "default_spec",
    "even_grid",
    "even_mesh",
    "meshing_for",
    "motion_mesh",
    "touched_places",
]


class Use(Enum):
    """Uses of a mesh, from the coarsest mesh to the finest."""

    SCREEN = (SCREEN_GRID, SCREEN_PUSHES)
    PAGE = (PAGE_GRID, REPLAY_PUSHES)
    REPLAY = (REPLAY_GRID, REPLAY_PUSHES)
    FINE = (FINE_GRID, FINE_PUSHES)


def default_spec(use: Use, geometry: Geometry, radius: float) -> Grading | PushMeshSpec:
    """The specification of a use, for a tool of this radius [m]; that of a free form has no pushes
    yet.
    """
    block, free_form = use.value
    return (block if geometry.is_block else free_form).for_tool(radius)


def default_mesh(use: Use, geometry: Geometry, radius: float, places: FloatArray) -> Meshing:
    """The mesh of a replay.

    Args:
        use: of the replay.
        geometry: of the phantom.
        radius: of the tool [m].
        places: (k, 3) that are pushed [m], phantom frame; each gets a mesh of a free form.
    """
    spec = default_spec(use, geometry, radius)
    return spec if isinstance(spec, Grading) else spec.at(places)


def meshing_for(setup: Setup, grid: Meshing) -> Meshing:
    """The mesh specification of a replay: the given one, unless the setup has an element size.

    An element size stands for an even grid of trilinear hexahedra.
    """
    if setup.element_size is None:
        return grid
    nx, ny, nz = (max(2, round(length / setup.element_size) + 1) for length in block_size(setup))
    return GridSpec(nodes=(nx, ny, nz))


def even_grid(geometry: Geometry, nodes: tuple[int, int, int]) -> BoxMesh:
    """Even grid of so many nodes along x, y, z through the bounds of any body."""
    x, y, z = (
        even_axis(float(low), float(high), count)
        for low, high, count in zip(geometry.low, geometry.high, nodes, strict=True)
    )
    return BoxMesh((x, y, z), np.array([0.0, 0.0, geometry.height]))


def even_mesh(setup: Setup, nodes: tuple[int, int, int]) -> Mesh:
    """The mesh of a body for slow changes in all of it, the same wherever the tool is.

    Hexahedra of a block have so many nodes along x, y, z; tetrahedra of any other body have edges
    as long as the shortest side of such a hexahedron.
    """
    size, centre = setup.geometry.size, np.zeros(3)
    if setup.geometry.is_block:
        return GridSpec(nodes=nodes).mesh(setup, centre)
    half = min(length / (count - 1) for length, count in zip(size, nodes, strict=True)) / 2
    return TetSpec(path=(), radius=half, spacing=half, coarsest=half).mesh(setup, centre)


def motion_mesh(use: Use, geometry: Geometry, radius: float, centres: FloatArray) -> Meshing:
    """The mesh of a replay of tool centres (f, 3) [m], phantom frame, of which not all touch."""
    if geometry.is_block:
        return default_mesh(use, geometry, radius, centres)
    places = touched_places(geometry, radius, centres)
    if not len(places):
        places = centres[[geometry.gap(centres, radius).argmin()]]
    return default_mesh(use, geometry, radius, places)


def touched_places(
    geometry: Geometry, radius: float, centres: FloatArray, known: Sequence[FloatArray] = ()
) -> FloatArray:
    """Places (k, 3) [m] of the surface that a tool touches, farther apart than its diameter.

    Args:
        geometry: of the phantom.
        radius: of the tool [m].
        centres: (f, 3) of the tool [m], phantom frame.
        known: places (3,) [m] that there are already; the result begins with them.
    """
    kept = list(known)
    touching = centres[geometry.gap(centres, radius) < CLEARANCE]
    distance, normals = geometry.facing(touching)
    for place in touching - distance[:, None] * normals:
        if all(np.linalg.norm(place - other) > 2 * radius for other in kept):
            kept.append(place)
    return np.array(kept).reshape(-1, 3)
