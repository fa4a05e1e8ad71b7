"""Meshes for many short pushes all over a body: one for each place that is pushed, small there and
nowhere else.

One mesh that is small wherever the tool goes would be small all over. The pushes are short and the
body rests between them, so that each may have a mesh of its own; a replay goes from one to the next
while the tool is clear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.gmsh_fill import TetSpec, check_spacing, fill
from palpate.mesh.protocol import FINER
from palpate.mesh.tet_mesh import TetMesh
from palpate.setup.closest_point import nearest
from palpate.setup.shape import Shape

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["FINE_PUSHES", "REPLAY_PUSHES", "SCREEN_PUSHES", "PushMeshSpec"]

_SLENDER = 0.2
"""Of the body's shortest extent, half of the longest edge anywhere: fewer elements would cut its
roundings off [1]."""
_KEPT = 256
"""Meshes that a process keeps: three for each of some eighty pushes."""


@dataclass(frozen=True, kw_only=True)
class PushMeshSpec:
    """How a shape is meshed under pushes.

    Attributes:
        places: of the surface that are pushed [m], phantom frame.
        reach: within which of a place its mesh is finest [m].
        spacing: of the nodes there [m], half an edge.
        growth: of an edge's length with the distance from there [1].
        coarsest: spacing far away [m].
    """

    places: tuple[tuple[float, float, float], ...] = ()
    reach: float = 4e-3
    spacing: float = 1.6e-3
    growth: float = 0.6
    coarsest: float = 4e-3

    def __post_init__(self) -> None:
        check_spacing(self.spacing, self.coarsest)

    def at(self, places: FloatArray) -> PushMeshSpec:
        """The same for pushes at these places (k, 3) [m]."""
        return replace(self, places=tuple((float(x), float(y), float(z)) for x, y, z in places))

    def for_tool(self, radius: float) -> PushMeshSpec:
        """What this is for a ball of 5 mm, for one of another radius [m]."""
        factor = radius / 5e-3
        spacing = self.spacing * factor
        return replace(
            self, reach=self.reach * factor, spacing=spacing, coarsest=max(self.coarsest, spacing)
        )

    def mesh(self, setup: Setup, centre: FloatArray) -> TetMesh:
        """That of the push nearest to a tool's centre (3,) [m]."""
        if not self.places:
            raise MeshError(
                f"{setup.shape.name}: no place that is pushed was named; name one at least",
                places=0,
            )
        number = int(np.linalg.norm(np.array(self.places) - centre, axis=1).argmin())
        return _filled(setup.shape, self.places[number], replace(self, places=()))

    def finer(self) -> Self:
        """With nodes FINER times closer."""
        return replace(self, spacing=self.spacing / FINER, coarsest=self.coarsest / FINER)


@lru_cache(maxsize=_KEPT)
def _filled(shape: Shape, place: tuple[float, float, float], spec: PushMeshSpec) -> TetMesh:
    _, (centre,) = nearest(np.array([place]), shape.corners)
    size = TetSpec(
        path=((float(centre[0]), float(centre[1]), float(centre[2])),),
        radius=spec.reach,
        spacing=spec.spacing,
        growth=spec.growth,
        coarsest=max(spec.spacing, min(spec.coarsest, _SLENDER * min(shape.size))),
    )
    return fill(shape, size)


REPLAY_PUSHES = PushMeshSpec()
FINE_PUSHES = PushMeshSpec(spacing=1.25e-3, growth=0.55, coarsest=3.5e-3)
SCREEN_PUSHES = PushMeshSpec(spacing=2.2e-3, growth=0.8, coarsest=5e-3)
"""For a ball of 5 mm; `for_tool` has those of others. A diagnosis takes the first, the fine one to
say how far that is off, and the coarse one for what an effect would do."""
