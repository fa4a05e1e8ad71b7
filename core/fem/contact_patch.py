"""Contact on the part of the surface near the tool, in the dense numbering of its nodes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.fem.contact import assemble_contact, contact_energy
from palpate.fem.model import CONTACT_STIFFNESS, BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["ContactPatch"]

_EMPTY = np.empty(0)


class ContactPatch:
    """Sides of the surface near the tool.

    Args:
        model: the body.
        faces: (f,) of the model's free sides.
        nodes: (k,) all nodes of these sides, and perhaps more, in the order of the results.

    Attributes:
        count: of the last nodes to which all sides belong.
    """

    def __init__(self, model: BlockModel, faces: IntArray, nodes: IntArray) -> None:
        where = np.full(len(model.mesh.nodes), -1)
        where[nodes] = np.arange(len(nodes))
        self._set(faces, np.ascontiguousarray(where[model.topology.surface[faces]]), len(nodes))

    def _set(self, faces: IntArray, local: IntArray, nodes: int) -> None:
        self._faces, self._local, self._nodes = faces, local, nodes
        self._slots = _dense_slots(local, nodes)
        self._first = local.min(axis=1)
        self.count = nodes - int(self._first.min())

    def between_last(self, count: int) -> ContactPatch:
        """The sides that belong to so many of the last nodes, numbered from the first of these."""
        begin = self._nodes - count
        chosen = self._first >= begin
        part = ContactPatch.__new__(ContactPatch)
        part._set(self._faces[chosen], self._local[chosen] - begin, count)
        return part

    def count_within(
        self, model: BlockModel, positions: FloatArray, tool: ToolSphere, margin: float
    ) -> int:
        """How many of the last nodes hold all sides with a point in contact, or within a margin
        [m] of the tool; at least one side.
        """
        close = _close(
            self._local, model.face.shapes, positions, tool.centre, tool.radius + margin
        )
        if model.friction_potential is not None:
            friction = model.friction_potential.of(self._faces)
            close[friction.faces[(friction.limits > 0).any(axis=1)]] = True
        return self._nodes - int(self._first[close].min(initial=self._first.max()))

    def contact(
        self,
        model: BlockModel,
        positions: FloatArray,
        tool: ToolSphere,
        *,
        tangent: bool = True,
        bending: bool = True,
    ) -> tuple[FloatArray, FloatArray]:
        """Contact force (m,) and its tangent (m, m) at these positions (k, 3) of the nodes [m].

        Args:
            model: the body.
            positions: of the nodes [m].
            tool: the tool.
            tangent: False leaves the tangent empty.
            bending: False leaves out the contact's curvature.
        """
        size = positions.size
        force, data = np.zeros_like(positions), np.zeros(size**2) if tangent else _EMPTY
        assemble_contact(
            self._local,
            model.areas[self._faces],
            model.face.shapes,
            model.face.gradients,
            positions,
            tool.centre,
            tool.radius,
            False,
            not model.dense,
            CONTACT_STIFFNESS,
            bending,
            self._slots,
            force,
            data,
            np.zeros(3),
        )
        if model.friction_potential is not None:
            friction = model.friction_potential.of(self._faces)
            friction.assemble(
                self._local,
                model.face,
                positions,
                tool.centre,
                self._slots,
                force,
                data,
                np.zeros(3),
            )
        return force.ravel(), data.reshape(size, size) if tangent else data

    def energy(self, model: BlockModel, positions: FloatArray, tool: ToolSphere) -> float:
        """Energy of the contact over E [m^3]; arguments as of `contact`."""
        total = contact_energy(
            self._local,
            model.areas[self._faces],
            model.face.shapes,
            model.face.gradients,
            positions,
            tool.centre,
            tool.radius,
            False,
            not model.dense,
            CONTACT_STIFFNESS,
        )
        if model.friction_potential is not None:
            total += model.friction_potential.of(self._faces).energy(
                self._local, model.face, positions, tool.centre
            )
        return float(total)


@njit(cache=True)
def _close(faces: Any, shapes: Any, positions: Any, centre: Any, radius: float) -> Any:
    """Which faces (f,) have a point within a radius of a centre (3,) [m].

    Args:
        faces: (f, b) nodes.
        shapes: (p, b) shape functions at the points.
        positions: (k, 3) [m].
        centre: (3,) [m].
        radius: [m].
    """
    close = np.zeros(faces.shape[0], dtype=np.bool_)
    for f in range(faces.shape[0]):
        for q in range(shapes.shape[0]):
            square = 0.0
            for i in range(3):
                place = -centre[i]
                for a in range(faces.shape[1]):
                    place += shapes[q, a] * positions[faces[f, a], i]
                square += place * place
            if square < radius * radius:
                close[f] = True
                break
    return close


def _dense_slots(local: IntArray, count: int) -> IntArray:
    """Positions of the entries of each face's matrix in a dense matrix of all nodes (f, 3 b, 3 b).

    They are -1 for nodes outside.
    """
    numbers = (3 * local[:, :, None] + np.arange(3)).reshape(len(local), -1)
    return np.ascontiguousarray(numbers[:, :, None] * 3 * count + numbers[:, None, :]).astype(
        np.int32
    )
