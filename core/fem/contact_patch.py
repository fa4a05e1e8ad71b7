"""Contact on the part of the surface near the tool, in the dense numbering of its nodes, and its
balance with the body condensed on them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit
from numpy.linalg import LinAlgError
from scipy.linalg import cho_factor, cho_solve

from palpate.fem.contact import assemble_contact, contact_energy
from palpate.fem.model import CONTACT_STIFFNESS, BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["ContactBalance", "ContactPatch"]

_EMPTY = np.empty(0)
_MOST_STEPS, _TOLERANCE = 60, 1e-8
"""Steps of a balance, and the longest motion of its last step [m]."""
_SHRINKING = 0.25
"""A factor is kept while each step is shorter than this share of the one before [1]."""


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
        close = _close(self._local, model.face.shapes, positions, tool.centre, tool.radius + margin)
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


class ContactBalance:
    """Contact, and the linear body that it presses.

    Args:
        patch: sides that may touch.
        stiffness: (m, m) of the body over E, condensed on their nodes [m].
    """

    def __init__(self, patch: ContactPatch, stiffness: FloatArray) -> None:
        self._patch, self._stiffness = patch, stiffness
        self._factor: tuple[FloatArray, bool] | None = None

    def change(
        self, model: BlockModel, here: FloatArray, tool: ToolSphere, load: FloatArray
    ) -> FloatArray | None:
        """The change (m,) that minimises the energy of body and contact [m]; None if Newton's
        method with a line search does not find it.

        The factor of the last balance is used as long as the steps shrink fast (modified Newton).

        Args:
            model: the body.
            here: (k, 3) of the nodes before the change [m].
            tool: the tool.
            load: (m,) over E [m^2].
        """
        change, pulled = np.zeros(len(load)), np.zeros(len(load))
        energy, longest = self._patch.energy(model, here, tool), np.inf
        for _ in range(_MOST_STEPS):
            place = here + change.reshape(-1, 3)
            slope, move = self._move(model, place, tool, load + pulled, longest)
            stretched = self._stiffness @ move
            length = 1.0
            while length > 1e-3:
                trial = change + length * move
                value = self._patch.energy(model, here + trial.reshape(-1, 3), tool) + float(
                    (0.5 * (pulled + length * stretched) + load) @ trial
                )
                if value <= energy + 1e-4 * length * float(slope @ move) + model.rounding:
                    break
                length /= 2
            change, pulled, energy = trial, pulled + length * stretched, value
            longest = float(np.abs(move).max()) if length == 1.0 else 0.0
            if float(np.abs(move).max()) < _TOLERANCE:
                return change
        return None

    def _move(
        self,
        model: BlockModel,
        place: FloatArray,
        tool: ToolSphere,
        load: FloatArray,
        longest: float,
    ) -> tuple[FloatArray, FloatArray]:
        """Gradient of the energy (m,) and a step (m,): that of the stored factor, if it is short
        enough beside the longest motion of the step before [m], or Newton's.

        The contact's curvature is left out if the tangent with it is not positive.
        """
        if self._factor is not None:
            slope = load + self._patch.contact(model, place, tool, tangent=False)[0]
            move = -cho_solve(self._factor, slope, check_finite=False)
            if float(np.abs(move).max()) < _SHRINKING * longest:
                return slope, np.asarray(move)
        force, tangent = self._patch.contact(model, place, tool)
        slope = load + force
        tangent += self._stiffness
        try:
            # In column order, which its symmetry allows, it is factorised in place.
            self._factor = cho_factor(tangent.T, overwrite_a=True, check_finite=False)
            return slope, np.asarray(-cho_solve(self._factor, slope, check_finite=False))
        except LinAlgError:
            self._factor = None
            tangent = self._patch.contact(model, place, tool, bending=False)[1]
            return slope, np.asarray(-np.linalg.solve(self._stiffness + tangent, slope))


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
