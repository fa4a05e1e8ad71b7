"""Hexahedra as large as the place asks for: a block's mesh by sizes and not by numbers.

A fixed number of nodes along an axis is spread thinly where the tool stands amid a long face, and
wasted where it stands near an edge. Seven pushes all over the block are 3.5 % off with 1700 to 2200
nodes graded so, the worst 5.4 %; with 13x9x9 quadratic nodes 7 to 9 % and 16 %, although a poke in
the very middle of the top, alone, is 8 % off there (`python -m benchmarks gradings`).

Far from the tool the edges stop growing, at a third of the shortest side. Where they do not, the
sag of a heavy block is off by a tenth and changes as much with the place of the focus, so that a
push into a side speaks against a weight that is there.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.box_mesh import BoxMesh, focus_of, with_midpoints
from palpate.mesh.grid_axes import sized_axis, split_near
from palpate.mesh.protocol import FINER

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["FINE_GRID", "PAGE_GRID", "REPLAY_GRID", "SCREEN_GRID", "Grading"]

_USUAL_RADIUS = 5e-3
_LOOSE, _LOOSE_GROWTH, _LOOSE_STEP = 3.2, 0.6, 1e-3
"""Longest edge where a base begins to be held, over the spacing at the focus [1]; its growth [1];
and the steps in which the mesh follows that line [m], for each new mesh costs a factor's analysis.
Elements of 12 mm there, half of each held, made a strip of 16 mm out to be 18 mm and hardly told it
from one of 20."""


@dataclass(frozen=True, kw_only=True)
class Grading:
    """How large a block's hexahedra are: the edge's length grows with the distance from the focus,
    on the surface below the tool.

    Attributes:
        spacing: distance of the nodes [m] at the focus.
        along, inward: growth of the edge's length over the distance [1], across the face that is
            pushed and into the body.
        longest: edge, as a share of the block's shortest side [1]: what a body does as a whole, its
            sag above all, wants a few elements everywhere, wherever the tool is.
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
                f"a mesh's longest edge is 0 to 1 of the block's shortest side, got {self.longest:g}",
                longest=self.longest,
            )
        if self.order not in (1, 2):
            raise MeshError(f"elements are of order 1 or 2, got {self.order}", order=self.order)

    def mesh(self, setup: Setup, centre: FloatArray) -> BoxMesh:
        """The mesh for a tool's centre (3,) [m]; the same object for places next to each other."""
        size = setup.box.size
        x, y, z = focus_of(size, centre).tolist()
        return _mesh(size, self, (x, y, z), _loose_edges(setup))

    def finer(self) -> Grading:
        """With nodes FINER times closer everywhere."""
        names = ("spacing", "along", "inward", "longest")
        return replace(self, **{name: getattr(self, name) / FINER for name in names})

    def for_tool(self, radius: float) -> Grading:
        """What this grading is for a ball of 5 mm, for one of another radius [m]."""
        return replace(self, spacing=self.spacing * radius / _USUAL_RADIUS)


def _loose_edges(setup: Setup) -> tuple[tuple[int, float], ...]:
    """Axis and place [m] of each line where a base begins to be held."""
    found = []
    for strip in setup.support.detached:
        axis, sign = "xy".index(strip.edge[1]), -1 if strip.edge[0] == "-" else 1
        place = sign * (setup.box.size[axis] / 2 - strip.extent)
        found.append((axis, round(place / _LOOSE_STEP) * _LOOSE_STEP))
    return tuple(found)


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
"""For a ball of 5 mm; `for_tool` has those of others. A diagnosis takes the first, the fine one to
say how far that is off, and the coarse one for what an effect would do: 1000 nodes, and a pattern
with a correlation of 0.99 with the first one's."""
