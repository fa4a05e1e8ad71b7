"""Interfaces of meshes and of mesh specifications that the engine uses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.elements import Element

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["FINER", "Connectivity", "Mesh", "Meshing"]

FINER = 1.5
"""Ratio of node spacings of a mesh and the finer mesh by which its error is estimated [1]."""


@dataclass(frozen=True, eq=False)
class Connectivity:
    """Connectivity of a mesh, without coordinates.

    Attributes:
        element: kind of the elements.
        count: number of nodes.
        elements: (e, a) nodes.
        surface: (f, b) nodes of the elements' sides on the free surface, outwards by the right-hand
            rule.
        base: (f, b) nodes of the elements' sides that are held, likewise.
        hull: (h, 3) or (h, 4) flat polygons of neighbouring nodes over the whole surface,
            counter-clockwise from outside.
        base_nodes: (k,) nodes of the base.
    """

    element: Element
    count: int
    elements: IntArray
    surface: IntArray
    base: IntArray
    hull: IntArray
    base_nodes: IntArray


class Mesh(Protocol):
    """A body at rest, filled with elements; two meshes are equal only if they are one object."""

    def __hash__(self) -> int: ...

    @property
    def nodes(self) -> FloatArray:
        """Rest positions (n, 3) [m], phantom frame."""

    @property
    def connectivity(self) -> Connectivity:
        """Connectivity, shared by meshes that differ only in node positions."""

    @property
    def focus(self) -> FloatArray:
        """The finest point (3,) [m] of a mesh that follows the tool; a constant for other
        meshes.
        """

    @property
    def near_focus(self) -> IntArray:
        """Nodes (k,) of the free surface around the focus, where the tool presses; none without a
        focus.
        """

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find elements' nodes and shape functions (m, a) at rest positions (m, 3) [m].

        Points outside are moved into the body.
        """

    def interpolate(self, field: FloatArray, points: FloatArray) -> FloatArray:
        """Interpolate a nodal field (n, c) at rest positions (m, 3) [m], as `locate` does."""

    @property
    def axes(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Coordinates along x, y, z [m] of a grid over the body, for pictures of its inside."""

    def on_axes(self, field: FloatArray) -> FloatArray:
        """A nodal field (n, c) at the grid of `axes` (nz ny nx, c), x fastest; that of the nearest
        place of the body outside.
        """

    def scaled(self, factors: FloatArray) -> Mesh:
        """The same elements in a body whose coordinates are multiplied by these factors (3,)
        [1].
        """


class Meshing(Protocol):
    """A mesh specification of a body."""

    def mesh(self, setup: Setup, centre: FloatArray) -> Mesh:
        """The mesh for a tool's centre (3,) [m]; the same object wherever the same mesh serves."""

    def finer(self) -> Self:
        """The same with nodes FINER times closer, or as nearly so as whole elements allow."""
