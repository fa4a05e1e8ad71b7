"""Meshes for many short pushes all over a body: one for each pushed place, fine only there.

One mesh for all pushes would be fine everywhere. The pushes are short and the body rests between
them, so each may have its own mesh; a replay changes the mesh while the tool is clear.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Self

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.cast_mesh import as_built
from palpate.mesh.protocol import FINER
from palpate.mesh.tet_fill import TetSpec, check_spacing, fill
from palpate.mesh.tet_mesh import TetMesh
from palpate.setup.free_form.closest_point import nearest
from palpate.setup.free_form.shape import Shape

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["FINE_PUSHES", "REPLAY_PUSHES", "SCREEN_PUSHES", "PushMeshSpec"]

_SLENDER = 0.2
"""Half of the longest edge anywhere, over the body's shortest extent [1]: fewer elements would cut
off its roundings."""
_CACHED = 256
"""Meshes that a process caches: three for each of some eighty pushes."""


@dataclass(frozen=True, kw_only=True)
class PushMeshSpec:
    """Mesh of a shape under pushes.

    Attributes:
        places: points of the surface that are pushed [m], phantom frame.
        reach: distance from such a point within which its mesh is finest [m].
        spacing: of the nodes there [m], half an edge.
        growth: increase of an edge's length per distance from there [1].
        coarsest: spacing far away [m].
        touched: distance from such a point within which a deep push touches the surface [m].
    """

    places: tuple[tuple[float, float, float], ...] = ()
    reach: float = 4e-3
    spacing: float = 1.6e-3
    growth: float = 0.6
    coarsest: float = 4e-3
    touched: float = field(default=10.4e-3, repr=False)

    def __post_init__(self) -> None:
        check_spacing(self.spacing, self.coarsest)

    def at(self, places: FloatArray) -> PushMeshSpec:
        """The same for pushes at these points (k, 3) [m]."""
        return replace(self, places=tuple((float(x), float(y), float(z)) for x, y, z in places))

    def for_tool(self, radius: float) -> PushMeshSpec:
        """Scale this specification, made for a ball of 5 mm, to another radius [m]."""
        factor = radius / 5e-3
        spacing = self.spacing * factor
        return replace(
            self,
            reach=self.reach * factor,
            spacing=spacing,
            coarsest=max(self.coarsest, spacing),
            touched=self.touched * factor,
        )

    def mesh(self, setup: Setup, centre: FloatArray) -> TetMesh:
        """The mesh of the push nearest to a tool's centre (3,) [m]."""
        shape = setup.stated_shape
        if not self.places:
            raise MeshError(
                f"{shape.name}: no place that is pushed was named; name one at least", places=0
            )
        number = int(np.linalg.norm(np.array(self.places) - centre, axis=1).argmin())
        return as_built(_filled(shape, self.places[number], replace(self, places=())), setup)

    def finer(self) -> Self:
        """The same with nodes FINER times closer."""
        return replace(self, spacing=self.spacing / FINER, coarsest=self.coarsest / FINER)


@lru_cache(maxsize=_CACHED)
def _filled(shape: Shape, place: tuple[float, float, float], spec: PushMeshSpec) -> TetMesh:
    _, (centre,) = nearest(np.array([place]), shape.corners)
    size = TetSpec(
        path=((float(centre[0]), float(centre[1]), float(centre[2])),),
        radius=spec.reach,
        spacing=spec.spacing,
        growth=spec.growth,
        coarsest=max(spec.spacing, min(spec.coarsest, _SLENDER * min(shape.size))),
    )
    return fill(shape, size).focused(centre, spec.touched)


REPLAY_PUSHES = PushMeshSpec(reach=6.5e-3, spacing=1.3e-3)
FINE_PUSHES = PushMeshSpec(reach=6.5e-3, spacing=1.05e-3, growth=0.55, coarsest=3.5e-3)
SCREEN_PUSHES = PushMeshSpec(spacing=2.2e-3, growth=0.8, coarsest=5e-3)
"""Specifications for a ball of 5 mm; `for_tool` scales them. A diagnosis replays with
REPLAY_PUSHES, estimates the mesh error with FINE_PUSHES, and screens effects with SCREEN_PUSHES. At
a depth of 8 mm a ball of 5 mm touches what was up to 7 mm from the pushed place: with a reach of
4 mm the surface of six bodies was 7 to 13 % off (`benchmarks.shape_accuracy`)."""
