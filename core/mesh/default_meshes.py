"""The mesh that each use takes where nobody asks for another, for a phantom of any shape."""

from __future__ import annotations

from enum import Enum

from palpate.foundation.arrays import FloatArray
from palpate.mesh.graded_mesh import FINE_GRID, PAGE_GRID, REPLAY_GRID, SCREEN_GRID, Grading
from palpate.mesh.protocol import Meshing
from palpate.mesh.push_meshes import FINE_PUSHES, REPLAY_PUSHES, SCREEN_PUSHES, PushMeshSpec
from palpate.setup.phantom_geometry import Geometry

__all__ = ["Use", "default_mesh", "default_spec"]


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


def default_mesh(use: Use, geometry: Geometry, radius: float, centres: FloatArray) -> Meshing:
    """The mesh of a replay.

    Args:
        use: of the replay.
        geometry: of the phantom.
        radius: of the tool [m].
        centres: (f, 3) of the tool [m], phantom frame, by which a free form's mesh is refined.
    """
    spec = default_spec(use, geometry, radius)
    return spec if isinstance(spec, Grading) else spec.at(centres)
