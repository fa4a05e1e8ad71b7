"""What the engine asks of a mesh, whatever its elements, and of the ways to make one."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol, Self

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.elements import Element

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["FINER", "Connectivity", "Mesh", "Meshing"]

FINER = 1.5
"""How many times closer the nodes of the finer mesh are, by which errors are estimated."""


@dataclass(frozen=True, eq=False)
class Connectivity:
    """Which nodes form what, wherever they lie.

    Attributes:
        element: the elements' kind.
        count: number of nodes.
        elements: (e, a) nodes.
        surface, base: (f, b) nodes of the elements' sides on the free surface and on what is held,
            outwards by the right-hand rule.
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
    """A body at rest, filled with elements; two are the same only if they are one object."""

    def __hash__(self) -> int: ...

    @property
    def nodes(self) -> FloatArray:
        """(n, 3) rest positions [m], phantom frame."""

    @property
    def connectivity(self) -> Connectivity:
        """Shared by meshes that differ only in where their nodes lie."""

    @property
    def focus(self) -> FloatArray:
        """Where a mesh that follows the tool is finest (3,) [m]; the same place for all meshes that
        do not.
        """

    @property
    def near_focus(self) -> IntArray:
        """Nodes (k,) of the free surface around the focus, on which a tool there presses; none
        where no tool is followed.
        """

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Elements' nodes and shape functions (m, a) at rest positions (m, 3) [m]; outside is moved
        into the body.
        """

    def interpolate(self, field: FloatArray, points: FloatArray) -> FloatArray:
        """A nodal field (n, c) at rest positions (m, 3) [m], with the shape functions of
        `locate`."""


class Meshing(Protocol):
    """How a body is meshed."""

    def mesh(self, setup: Setup, centre: FloatArray) -> Mesh:
        """The mesh for a tool's centre (3,) [m]; the same object where the same mesh will do."""

    def finer(self) -> Self:
        """With nodes FINER times closer, or as nearly so as whole elements allow."""
