"""Static condensation of a linearised body on the nodes near the tool, with exact contact.

Pushing a ball into a soft block changes the elastic tangent slowly, but the set of touching points
changes with every step. So the body's response M^-1 to forces on the surface near the tool is
computed once (static condensation on those nodes), and each step solves

    r(u) + M e - K e + f(u + e) - f(u) = 0

for the change e, with r the residual, f the true contact force and K the contact's share of M: a
small dense system, solved by Newton's method. The error left is the change of the elastic tangent;
the residual shrinks from step to step.
"""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cho_factor, cho_solve

from palpate.fem.contact import assemble_contact, contact_energy
from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import CONTACT_STIFFNESS, BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["CondensedContact"]

_MARGIN, _EDGES = 5e-4, 0.3
"""Surface nodes within this distance of the ball [m], or this share of their side's length, are
condensed: they may come into contact in the next steps. A node further off that does so shows in
the residual, and is included by the next linearisation."""
_INNER_STEPS = 25
_INNER_TOLERANCE = 1e-8


class CondensedContact:
    """The body's response to forces near the tool, linearised at one state; made by `at`."""

    def __init__(
        self,
        model: BlockModel,
        faces: IntArray,
        nodes: IntArray,
        positions: FloatArray,
        tool: ToolSphere,
    ) -> None:
        self._faces, self._nodes = faces, nodes
        self._unknown = model.topology.unknown[nodes].ravel()
        where = np.full(len(model.mesh.nodes), -1)
        where[nodes] = np.arange(len(nodes))
        self._local = np.ascontiguousarray(where[model.topology.surface[faces]])
        self._slots = _dense_slots(self._local, len(nodes))
        self._share = self._contact(model, positions[nodes], tool, bending=False)[1]
        self._condensed = np.linalg.inv(model.topology.factor.inverse_entries(self._unknown))
        self._stiffness = self._condensed - self._share
        self._topology, self._generation = model.topology, model.topology.factor.generation

    def fits(self, model: BlockModel) -> bool:
        """Whether the factor is still stored, and belongs to a grid with the same elements."""
        return (
            model.topology is self._topology
            and model.topology.factor.generation == self._generation
        )

    @classmethod
    def at(cls, model: BlockModel, positions: FloatArray, tool: ToolSphere) -> Self | None:
        """Linearise at these positions (n, 3) [m].

        Returns None if nothing is near the tool or the tangent has no factor.
        """
        top = model.topology
        distance = np.linalg.norm(positions[top.surface] - tool.centre, axis=2)
        edges = np.linalg.norm(positions[top.surface] - positions[top.surface[:, :1]], axis=2).max(
            axis=1
        )
        near = np.flatnonzero(
            distance.min(axis=1) < tool.radius + np.maximum(_MARGIN, _EDGES * edges)
        )
        nodes = np.unique(top.surface[near])
        nodes = nodes[top.free[nodes].all(axis=1)]
        near = near[np.isin(top.surface[near], nodes).all(axis=1)]
        if not len(near):
            return None
        state = model.assemble(positions, tool, bending=False)
        try:
            model.factorise(state.data)
        except NotPositiveDefinite:
            return None
        return cls(model, near, nodes, positions, tool)

    def _contact(
        self, model: BlockModel, positions: FloatArray, tool: ToolSphere, *, bending: bool = True
    ) -> tuple[FloatArray, FloatArray]:
        """Contact force (m,) and its tangent (m, m) on the nodes near the tool, at these
        positions.
        """
        force, data = np.zeros_like(positions), np.zeros(positions.size**2)
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
        return force.ravel(), data.reshape(positions.size, positions.size)

    def step(
        self, model: BlockModel, positions: FloatArray, residual: FloatArray, tool: ToolSphere
    ) -> FloatArray | None:
        """Positions after one step; None if the contact finds no balance."""
        free = model.topology.factor.approximate(residual)
        here = positions[self._nodes]
        contact, _ = self._contact(model, here, tool)
        change = self._balance(model, here, tool, self._condensed @ free[self._unknown] - contact)
        if change is None:
            return None
        force, _ = self._contact(model, here + change.reshape(-1, 3), tool)
        moved = positions.copy()
        further = np.zeros_like(residual)
        further[self._unknown] = force - contact - self._share @ change
        moved[model.topology.free] -= free + model.topology.factor.approximate(further)
        return moved

    def _balance(
        self, model: BlockModel, here: FloatArray, tool: ToolSphere, load: FloatArray
    ) -> FloatArray | None:
        """The change (m,) that minimises the energy of condensed body and contact.

        Newton's method with a line search; None if it does not converge.
        """
        change = np.zeros(len(load))
        energy = self._energy(model, here, tool, load, change)
        for _ in range(_INNER_STEPS):
            slope, move = self._move(model, here, tool, load, change)
            length = 1.0
            while length > 1e-3:
                value = self._energy(model, here, tool, load, change + length * move)
                if value <= energy + 1e-4 * length * float(slope @ move) + model.rounding:
                    break
                length /= 2
            change, energy = change + length * move, value
            if float(np.abs(move).max()) < _INNER_TOLERANCE:
                return change
        return None

    def _move(
        self,
        model: BlockModel,
        here: FloatArray,
        tool: ToolSphere,
        load: FloatArray,
        change: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Gradient of the condensed energy (m,) and Newton's step (m,).

        The contact's curvature is left out if the tangent with it is not positive.
        """
        force, tangent = self._contact(model, here + change.reshape(-1, 3), tool)
        slope = self._stiffness @ change + load + force
        try:
            factor = cho_factor(self._stiffness + tangent, check_finite=False)
            return slope, np.asarray(-cho_solve(factor, slope, check_finite=False))
        except LinAlgError:
            _, tangent = self._contact(model, here + change.reshape(-1, 3), tool, bending=False)
            return slope, np.asarray(-np.linalg.solve(self._stiffness + tangent, slope))

    def _energy(
        self,
        model: BlockModel,
        here: FloatArray,
        tool: ToolSphere,
        load: FloatArray,
        change: FloatArray,
    ) -> float:
        """Energy over E [m^3] of the condensed body and the contact."""
        contact = contact_energy(
            self._local,
            model.areas[self._faces],
            model.face.shapes,
            model.face.gradients,
            here + change.reshape(-1, 3),
            tool.centre,
            tool.radius,
            False,
            not model.dense,
            CONTACT_STIFFNESS,
        )
        if model.friction_potential is not None:
            contact += model.friction_potential.of(self._faces).energy(
                self._local, model.face, here + change.reshape(-1, 3), tool.centre
            )
        return float(0.5 * change @ self._stiffness @ change + load @ change + contact)


def _dense_slots(local: IntArray, count: int) -> IntArray:
    """Positions of the entries of each face's matrix in a dense matrix of all nodes (f, 3 b, 3 b).

    They are -1 for nodes outside.
    """
    numbers = (3 * local[:, :, None] + np.arange(3)).reshape(len(local), -1)
    return np.ascontiguousarray(numbers[:, :, None] * 3 * count + numbers[:, None, :]).astype(
        np.int32
    )
