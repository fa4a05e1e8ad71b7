"""Graded hexahedral meshes of a block, by element sizes instead of node counts.

A fixed number of nodes along an axis is too sparse for a tool amid a long face, and wasteful for
one near an edge. Measured over seven pushes all over the block: 3.5 % error on average and 5.4 % at
worst with 1700 to 2200 nodes graded by size; 7 to 9 % and 16 % with 13x9x9 quadratic nodes, and 8 %
for a single poke in the middle of the top (`python -m benchmarks mesh_grading`).

Far from the tool the edges stop growing, at a third of the shortest side. Without that limit, the
sag of a heavy block is off by a tenth and changes as much with the position of the focus, so that a
push into a side contradicts a weight that is present.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.box_mesh import BoxMesh, block_size, focus_of, with_midpoints
from palpate.mesh.grid_axes import sized_axis, split_near
from palpate.mesh.protocol import FINER

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["FINE_GRID", "PAGE_GRID", "REPLAY_GRID", "SCREEN_GRID", "Grading"]

_USUAL_RADIUS = 5e-3
"""Radius of the tool for which the gradings below are made [m]."""
_LOOSE, _LOOSE_GROWTH, _LOOSE_STEP = 3.2, 0.6, 1e-3
"""Longest edge near the line at which a base begins to be held, over the spacing at the focus [1];
growth of the edges from there [1]; and the step to which that line is rounded [m], because each new
mesh costs an analysis of its factor. Measured: with elements of 12 mm there, half of each held, a
strip of 16 mm was estimated as 18 mm and hardly distinguished from one of 20 mm."""


@dataclass(frozen=True, kw_only=True)
class Grading:
    """Element sizes of a block: the edge's length grows with the distance from the focus.

    The focus is on the surface below the tool.

    Attributes:
        spacing: distance of the nodes at the focus [m].
        along: growth of the edge's length per distance across the face that is pushed [1].
        inward: growth of the edge's length per distance into the body [1].
        longest: longest edge over the block's shortest side [1]; deformation of the whole body,
            above all its sag, needs a few elements everywhere.
        order: of the shape functions, 1 (8 nodes an element) or 2 (27 nodes).
    """

    spacing: float
    along: float = 0.5
    inward: float = 0.9
    longest: float = 1.0
    order: int = 2

    def __post_init__(self) -> None:
        if not 0 < self.spacing < 1:
            raise MeshError(
                f"element spacing {self.spacing:g} m is not between 0 and 1 m", spacing=self.spacing
            )
        for name, growth in (("along", self.along), ("inward", self.inward)):
            if not 0 < growth <= 10:
                raise MeshError(
                    f"a mesh's growth {name} is between 0 and 10, got {growth:g}", growth=growth
                )
        if not 0 < self.longest <= 1:
            raise MeshError(
                "a mesh's longest edge is 0 to 1 of the block's shortest side, "
                f"got {self.longest:g}",
                longest=self.longest,
            )
        if self.order not in (1, 2):
            raise MeshError(f"elements are of order 1 or 2, got {self.order}", order=self.order)

    def mesh(self, setup: Setup, centre: FloatArray) -> BoxMesh:
        """The mesh for a tool's centre (3,) [m]; the same object for positions next to each
        other.
        """
        size = block_size(setup)
        x, y, z = focus_of(size, centre).tolist()
        return _mesh(size, self, (x, y, z), _loose_edges(setup))

    def finer(self) -> Grading:
        """The same with nodes FINER times closer everywhere."""
        names = ("spacing", "along", "inward", "longest")
        return replace(self, **{name: getattr(self, name) / FINER for name in names})

    def for_tool(self, radius: float) -> Grading:
        """Scale this grading, made for a ball of 5 mm, to another radius [m]."""
        return replace(self, spacing=self.spacing * radius / _USUAL_RADIUS)


def _loose_edges(setup: Setup) -> tuple[tuple[int, float], ...]:
    """Axis and coordinate [m] of each line at which a base begins to be held."""
    lines = []
    for strip in setup.support.detached:
        axis, sign = "xy".index(strip.edge[1]), -1 if strip.edge[0] == "-" else 1
        place = sign * (block_size(setup)[axis] / 2 - strip.extent)
        lines.append((axis, round(place / _LOOSE_STEP) * _LOOSE_STEP))
    return tuple(lines)


@lru_cache(maxsize=64)
def _mesh(
    size: tuple[float, float, float],
    grading: Grading,
    focus: tuple[float, float, float],
    loose: tuple[tuple[int, float], ...] = (),
) -> BoxMesh:
    lows, highs = (-size[0] / 2, -size[1] / 2, 0.0), (size[0] / 2, size[1] / 2, size[2])
    axes: list[FloatArray] = []
    for low, high, at in zip(lows, highs, focus, strict=True):
        growth = grading.inward if at in (low, high) else grading.along
        axis = sized_axis(
            low, high, at, grading.spacing * grading.order, growth, grading.longest * min(size)
        )
        for number, place in loose:
            if number == len(axes):
                axis = split_near(axis, place, _LOOSE * grading.spacing, _LOOSE_GROWTH)
        axes.append(with_midpoints(axis) if grading.order == 2 else axis)
    return BoxMesh((axes[0], axes[1], axes[2]), np.array(focus), grading.order)


REPLAY_GRID = Grading(spacing=1.25e-3, along=0.6, inward=1.2, longest=0.35)
FINE_GRID = Grading(spacing=1e-3, along=0.7, inward=0.7, longest=0.25)
SCREEN_GRID = Grading(spacing=2.1e-3, along=0.6, inward=1.2, longest=0.5)
PAGE_GRID = Grading(spacing=1.5e-3, along=0.7, inward=1.2)
"""Gradings for a ball of 5 mm; `for_tool` scales them. A diagnosis replays with REPLAY_GRID,
estimates the mesh error with FINE_GRID, and screens effects with SCREEN_GRID: 1000 nodes, and error
patterns that correlate to 0.99 with those of REPLAY_GRID."""
