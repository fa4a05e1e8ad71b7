"""Structured meshes of a block: hexahedra on an even grid, or graded towards a focus.

Grading matters more than the number of nodes: the contact zone of a 5 mm ball is a few millimetres
wide, and on an even 13x5x5 grid it lies within one element.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.mesh.elements import HEXAHEDRA
from palpate.mesh.grid_axes import even_axis, graded_axis
from palpate.mesh.interpolation import grid_shapes, weighted_nodes
from palpate.mesh.protocol import FINER, Connectivity

if TYPE_CHECKING:
    from palpate.setup.setup import Setup

__all__ = ["BoxMesh", "GridSpec", "block_size", "box_mesh", "focus_of", "with_midpoints"]

_FOCUS_STEP = 2e-4
"""Step to which the focus is rounded [m], so that neighbouring frames share a mesh."""


@dataclass(frozen=True, kw_only=True)
class GridSpec:
    """Mesh of a block by the number of nodes.

    Attributes:
        nodes: number of nodes along x, y, z.
        spacing: distance of the nodes [m] at the focus of a graded grid; None for an even grid.
        order: of the shape functions: 1 (8 nodes an element) or 2 (27 nodes, which needs an odd
            number of nodes along each axis).
    """

    nodes: tuple[int, int, int] = (13, 5, 5)
    spacing: float | None = None
    order: int = 1

    def __post_init__(self) -> None:
        if any(not 2 <= count <= 400 for count in self.nodes):
            raise MeshError(
                f"a grid needs 2 to 400 nodes along each axis, got {self.nodes}",
                nodes=list(self.nodes),
            )
        if self.spacing is not None and not 0 < self.spacing < 1:
            raise MeshError(
                f"element spacing {self.spacing:g} m is not between 0 and 1 m", spacing=self.spacing
            )

        if self.order not in (1, 2) or any((count - 1) % self.order for count in self.nodes):
            raise MeshError(
                "a grid is of order 1, or of order 2 with odd numbers of nodes; got order "
                f"{self.order} and {self.nodes}",
                nodes=list(self.nodes),
                order=self.order,
            )

    def finer(self) -> GridSpec:
        """The grid with its nodes 1.5 times closer, or as nearly so as whole elements allow."""

        def more(count: int) -> int:
            return round((count - 1) / self.order * FINER) * self.order + 1

        nx, ny, nz = self.nodes
        spacing = None if self.spacing is None else self.spacing / FINER
        return replace(self, nodes=(more(nx), more(ny), more(nz)), spacing=spacing)

    @classmethod
    def parse(cls, text: str) -> GridSpec:
        """Parse `13x5x5`."""
        try:
            nx, ny, nz = (int(part) for part in text.lower().split("x"))
        except ValueError:
            raise MeshError(
                f"a grid reads like 13x5x5 (nodes along x, y, z), got {text!r}", grid=text
            ) from None
        return cls(nodes=(nx, ny, nz))

    def mesh(self, setup: Setup, centre: FloatArray) -> BoxMesh:
        """The grid refined towards the surface point nearest to the tool."""
        size = block_size(setup)
        if self.spacing is None:
            return _mesh(size, self, (0.0, 0.0, size[2]))
        focus = focus_of(size, centre)
        return _mesh(size, self, (float(focus[0]), float(focus[1]), float(focus[2])))


def block_size(setup: Setup) -> tuple[float, float, float]:
    """Edge lengths [m] of a setup's block; MeshError for any other body."""
    if not setup.geometry.is_block:
        raise MeshError(
            f"{setup.stated_shape.name}: hexahedra fill a block only; mesh it with tetrahedra, and "
            "state no element size",
            key="geometry",
        )
    return setup.geometry.size


def focus_of(size: tuple[float, float, float], centre: FloatArray) -> FloatArray:
    """The surface point (3,) [m] nearest to a tool's centre.

    It moves in small steps, so that neighbouring frames share it.
    """
    half = np.array([size[0] / 2, size[1] / 2])
    low, high = np.append(-half, 0.0), np.append(half, size[2])
    focus = np.clip(np.round(centre / _FOCUS_STEP) * _FOCUS_STEP, low, high)
    # A centre pushed below the surface has its focus on the nearest side, the top if in doubt.
    if np.all((focus > low) & (focus < high)):
        gaps = np.concatenate([focus - low, high - focus])
        gaps[2] = np.inf
        side = int(np.argmin(gaps))
        focus[side % 3] = high[side % 3] if side >= 3 else low[side % 3]
    return np.asarray(focus)


def _quadratic(local: FloatArray) -> list[FloatArray]:
    """Values of the three quadratic Lagrange polynomials on [0, 1]."""
    return [(1 - local) * (1 - 2 * local), 4 * local * (1 - local), local * (2 * local - 1)]


def with_midpoints(ends: FloatArray) -> FloatArray:
    """Insert the midpoint of each interval between coordinates."""
    return np.insert(ends, np.arange(1, len(ends)), (ends[1:] + ends[:-1]) / 2)


@dataclass(frozen=True, eq=False)
class BoxMesh:
    """Nodes and hexahedra of a block; node (i, j, k) has number (k * ny + j) * nx + i.

    Attributes:
        axes: node coordinates along x, y, z [m], phantom frame.
        focus: the point of the finest mesh (3,) [m]; on a node, or between two if an axis has too
            few; the same point for all even grids of one block.
        order: of the shape functions, 1 or 2; with 2 every second node is the midpoint of its
            neighbours.
    """

    axes: tuple[FloatArray, FloatArray, FloatArray]
    focus: FloatArray
    order: int = 1

    def scaled(self, factors: FloatArray) -> BoxMesh:
        """The same hexahedra in a block whose edges are multiplied by these factors (3,) [1]."""
        x, y, z = (axis * factor for axis, factor in zip(self.axes, factors, strict=True))
        return BoxMesh((x, y, z), self.focus * factors, self.order)

    def on_axes(self, field: FloatArray) -> FloatArray:
        """A nodal field (n, c) at the grid of `axes`: the nodes themselves."""
        return field

    def __getstate__(self) -> dict[str, Any]:
        """Pickle only the defining fields; everything else is computed again on demand."""
        return {"axes": self.axes, "focus": self.focus, "order": self.order}

    @cached_property
    def shape(self) -> tuple[int, int, int]:
        """Number of nodes along x, y, z."""
        nx, ny, nz = (len(axis) for axis in self.axes)
        return nx, ny, nz

    @cached_property
    def nodes(self) -> FloatArray:
        """(n, 3) rest positions [m]."""
        z, y, x = np.meshgrid(self.axes[2], self.axes[1], self.axes[0], indexing="ij")
        return np.stack([x.ravel(), y.ravel(), z.ravel()], axis=1)

    @cached_property
    def _numbers(self) -> IntArray:
        nx, ny, nz = self.shape
        return np.arange(nx * ny * nz).reshape(nz, ny, nx)

    @cached_property
    def _steps(self) -> list[slice]:
        """Slices that select the first, second, ... node of every element along one axis."""
        return [
            slice(shift, shift - self.order or None, self.order) for shift in range(self.order + 1)
        ]

    @cached_property
    def hexahedra(self) -> IntArray:
        """(e, 8) or (e, 27) nodes; local numbers grow along x, then y, then z."""
        n, steps = self._numbers, self._steps
        return np.stack(
            [n[dz, dy, dx].ravel() for dz in steps for dy in steps for dx in steps], axis=1
        )

    @cached_property
    def _sides(self) -> dict[str, tuple[IntArray, bool]]:
        """Node numbers of each side in rows and columns, and whether its rows must be reversed.

        With reversed rows, the product of rows and columns points outwards.
        """
        n = self._numbers
        return {
            "-z": (n[0], True),
            "+z": (n[-1], False),
            "-y": (n[:, 0], False),
            "+y": (n[:, -1], True),
            "-x": (n[:, :, 0], True),
            "+x": (n[:, :, -1], False),
        }

    @cached_property
    def element_sides(self) -> dict[str, IntArray]:
        """Nodes (f, 4) or (f, 9) of the elements' sides, row by row.

        The cross product of the directions along and across the rows points outwards.
        """

        def patches(grid: IntArray, flip: bool) -> IntArray:
            rows = grid[::-1] if flip else grid
            return np.stack(
                [rows[down, along].ravel() for down in self._steps for along in self._steps], axis=1
            )

        return {side: patches(grid, flip) for side, (grid, flip) in self._sides.items()}

    @cached_property
    def faces(self) -> dict[str, IntArray]:
        """Quadrilaterals (f, 4) of neighbouring nodes on each side, counter-clockwise from
        outside.
        """

        def quads(grid: IntArray, flip: bool) -> IntArray:
            corners = [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]
            stacked = np.stack([corner.ravel() for corner in corners], axis=1)
            return stacked[:, ::-1] if flip else stacked

        return {side: quads(grid, flip) for side, (grid, flip) in self._sides.items()}

    @cached_property
    def free_surface(self) -> IntArray:
        """Quadrilaterals (f, 4) of the top and the four sides."""
        return np.concatenate([self.faces[side] for side in ("+z", "-y", "+y", "-x", "+x")])

    @cached_property
    def base_nodes(self) -> IntArray:
        """Nodes at z = 0."""
        return np.asarray(self._numbers[0].ravel())

    @cached_property
    def near_focus(self) -> IntArray:
        """Nodes (k,) of the free surface at most two elements from the focus.

        An even grid has none, because it does not follow the tool.
        """
        if all(np.allclose(np.diff(axis), axis[1] - axis[0]) for axis in self.axes):
            return np.empty(0, dtype=np.int64)
        middle = [
            int(np.argmin(np.abs(axis - at)))
            for axis, at in zip(self.axes, self.focus, strict=True)
        ]
        x, y, z = (
            np.flatnonzero(np.abs(np.arange(count) - at) <= 2 * self.order)
            for count, at in zip(self.shape, middle, strict=True)
        )
        return np.intersect1d(self._numbers[np.ix_(z, y, x)], self.free_surface)

    @property
    def connectivity(self) -> Connectivity:
        """Connectivity, shared by all grids of this shape and order."""
        return _connectivity(self.shape, self.order)

    def locate(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Find elements' nodes and shape functions (m, a) at rest positions (m, 3) [m].

        Points outside are moved to the surface of the block.
        """
        first, along = (
            np.empty((3, len(points)), dtype=np.int64),
            np.empty((3, self.order + 1, len(points))),
        )
        for axis, coordinates in enumerate(self.axes):
            ends = coordinates[:: self.order]
            value = np.clip(points[:, axis], ends[0], ends[-1])
            index = np.clip(np.searchsorted(ends, value, side="right") - 1, 0, len(ends) - 2)
            first[axis] = index * self.order
            local = (value - ends[index]) / (ends[index + 1] - ends[index])
            along[axis] = [1 - local, local] if self.order == 1 else _quadratic(local)
        return grid_shapes(first, along, *self.shape[:2])

    def shapes_along(self, axis: int, at: FloatArray) -> FloatArray:
        """Shape functions (p, n) of the nodes along one axis at coordinates (p,) [m] within the
        block.
        """
        ends = self.axes[axis][:: self.order]
        index = np.clip(np.searchsorted(ends, at, side="right") - 1, 0, len(ends) - 2)
        local = (at - ends[index]) / (ends[index + 1] - ends[index])
        shapes = np.zeros((len(at), len(self.axes[axis])))
        for step, values in enumerate([1 - local, local] if self.order == 1 else _quadratic(local)):
            shapes[np.arange(len(at)), index * self.order + step] = values
        return shapes

    def interpolate(self, field: FloatArray, points: FloatArray) -> FloatArray:
        """Interpolate a nodal field (n, c) at rest positions (m, 3) [m]."""
        nodes, weights = self.locate(points)
        return weighted_nodes(nodes, weights, field)


def box_mesh(
    size: tuple[float, float, float], grid: GridSpec, focus: FloatArray | None = None
) -> BoxMesh:
    """Mesh a block standing on z = 0, centred in x and y.

    Args:
        size: edge lengths [m].
        grid: nodes along the axes, and the grading.
        focus: (3,) point [m] towards which a graded grid is refined; the middle of the top by
            default.
    """
    lows, highs = (-size[0] / 2, -size[1] / 2, 0.0), (size[0] / 2, size[1] / 2, size[2])
    ends = [(count - 1) // grid.order + 1 for count in grid.nodes]
    centre = np.array([0.0, 0.0, size[2]])
    if grid.spacing is None:
        axes = [even_axis(low, high, n) for low, high, n in zip(lows, highs, ends, strict=True)]
    else:
        centre = centre if focus is None else np.clip(focus, lows, highs)
        edge = grid.spacing * grid.order
        axes = [
            graded_axis(low, high, n, float(at), edge)
            for low, high, n, at in zip(lows, highs, ends, centre, strict=True)
        ]
    if grid.order == 2:
        axes = [with_midpoints(axis) for axis in axes]
    return BoxMesh((axes[0], axes[1], axes[2]), centre, grid.order)


@lru_cache(maxsize=64)
def _mesh(
    size: tuple[float, float, float], grid: GridSpec, focus: tuple[float, float, float]
) -> BoxMesh:
    return box_mesh(size, grid, np.array(focus))


@lru_cache(maxsize=32)
def _connectivity(nodes: tuple[int, int, int], order: int) -> Connectivity:
    mesh = box_mesh((1.0, 1.0, 1.0), GridSpec(nodes=nodes, order=order))
    return Connectivity(
        element=HEXAHEDRA[order],
        count=len(mesh.nodes),
        elements=np.ascontiguousarray(mesh.hexahedra),
        surface=np.concatenate(
            [mesh.element_sides[side] for side in ("+z", "-y", "+y", "-x", "+x")]
        ),
        base=np.ascontiguousarray(mesh.element_sides["-z"]),
        hull=np.concatenate(list(mesh.faces.values())),
        base_nodes=mesh.base_nodes,
    )
