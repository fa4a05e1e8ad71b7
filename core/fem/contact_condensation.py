"""Static condensation of a linearised body on the nodes near the tool, with exact contact.

Pushing a ball into a soft block changes the elastic tangent slowly, but the set of touching points
changes with every step. So the body's stiffness K against forces on the surface near the tool is
computed once (static condensation on those nodes), and each step solves

    r(u) + M e - C e + f(u + e) - f(u) = 0

for the change e, with r the residual, M the tangent, f the true contact force and C the contact's
share of M, K being the Schur complement of M - C: a small dense system, solved by Newton's method.
The error left is the change of the elastic tangent; the residual shrinks from step to step.
"""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.linalg import LinAlgError
from scipy.linalg import cho_solve, cholesky, solve_triangular

from palpate.fem.contact_patch import ContactBalance, ContactPatch
from palpate.fem.linalg.direct_solver import NotPositiveDefinite
from palpate.fem.model import BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray, IntArray

__all__ = ["CondensedContact"]

_MARGIN, _EDGES = 5e-4, 0.3
"""Surface nodes within this distance of the ball [m], or this share of their side's length, may
come into contact in the next steps. A node further off that does so shows in the residual, and is
included by the next linearisation."""
_CELL = 4e-3
"""Away from a mesh's focus, the kept nodes are those in a box whose bounds are multiples of this
[m]: while the tool moves, they remain the same for a while, and so does the elimination order."""
_SOON = 1e-4
"""Points within this distance of the ball [m] are expected to touch in a step; if others do, the
step is balanced again with all nodes near the ball."""


class CondensedContact:
    """The body's response to forces near the tool, linearised at one state; made by `at`."""

    def __init__(
        self,
        model: BlockModel,
        faces: IntArray,
        kept: IntArray,
        positions: FloatArray,
        tool: ToolSphere,
    ) -> None:
        state = model.assemble(positions, tool, bending=False)
        model.spend(1.0)
        self._topology = top = model.topology
        self._condensation = top.factor.condense(state.data, top.unknown[kept].ravel())
        # The nearest nodes come last: in a Cholesky factor each trailing block is the stiffness
        # condensed on the last nodes.
        distance = np.linalg.norm(positions[kept] - tool.centre, axis=1)
        self._order = np.argsort(-distance, kind="stable")
        self._nodes = kept[self._order]
        self._rows = (3 * self._order[:, None] + np.arange(3)).ravel()
        self._faces = ContactPatch(model, faces, self._nodes)
        self._share = self._faces.contact(model, positions[self._nodes], tool, bending=False)[1]
        self._loaded = self._faces.count_within(model, positions[self._nodes], tool, 0.0)
        matrix = self._condensation.matrix[np.ix_(self._rows, self._rows)]
        try:
            self._factor: FloatArray = cholesky(matrix, overwrite_a=True, check_finite=False)
        except LinAlgError as error:
            raise NotPositiveDefinite("the condensed tangent has no Cholesky factor") from error
        self._parts: dict[int, _ActiveNodes] = {}

    def fits(self, model: BlockModel) -> bool:
        """Whether the factor is still stored, and belongs to a grid with the same elements."""
        return model.topology is self._topology and self._condensation.stored

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
        try:
            return cls(model, near, _kept_nodes(model, nodes), positions, tool)
        except NotPositiveDefinite:
            return None

    def step(
        self, model: BlockModel, positions: FloatArray, residual: FloatArray, tool: ToolSphere
    ) -> FloatArray | None:
        """One step of the unknowns (u,) [m]; None if the contact finds no balance."""
        reduced, partial = self._condensation.eliminate(-residual)
        here = positions[self._nodes]
        contact = self._faces.contact(model, here, tool, tangent=False)[0]
        load = -reduced[self._rows] - contact
        change = self._change(model, here, tool, load)
        if change is None:
            return None
        kept = np.empty_like(change)
        kept[self._rows] = change
        return self._condensation.substitute(partial, kept)

    def _change(
        self, model: BlockModel, here: FloatArray, tool: ToolSphere, load: FloatArray
    ) -> FloatArray | None:
        """The change (m,) of the kept unknowns that minimises the energy of condensed body and
        contact; None if none is found.
        """
        count = max(self._loaded, self._faces.count_within(model, here, tool, _SOON))
        for active in dict.fromkeys((count, self._faces.count)):
            change = self._part(active).change(model, here, tool, load)
            if change is None:
                return None
            moved = here + change.reshape(-1, 3)
            if active >= self._faces.count_within(model, moved, tool, 0.0):
                break
        return change

    def _part(self, active: int) -> _ActiveNodes:
        """The contact on the last nodes, so many of them."""
        if active not in self._parts:
            share = self._share[-3 * active :, -3 * active :]
            self._parts[active] = _ActiveNodes(
                self._faces.between_last(active), self._factor, share
            )
        return self._parts[active]


class _ActiveNodes:
    """Contact on the last of the kept nodes; the others follow them.

    Args:
        patch: sides between the last nodes.
        factor: (m, m) upper Cholesky factor of the body's stiffness over E with the contact's
            share.
        share: (k, k) of the contact in it [m], which belongs to the last nodes alone.
    """

    def __init__(self, patch: ContactPatch, factor: FloatArray, share: FloatArray) -> None:
        self._first = first = len(factor) - len(share)
        self._factor, last = np.asfortranarray(factor[:first, :first]), factor[first:, first:]
        self._balance = ContactBalance(patch, last.T @ last - share)
        self._response = factor[:first, first:]
        if first:
            self._response = solve_triangular(self._factor, self._response, check_finite=False)

    def change(
        self, model: BlockModel, here: FloatArray, tool: ToolSphere, load: FloatArray
    ) -> FloatArray | None:
        """The change of all kept unknowns (m,), as of `ContactBalance.change`."""
        first, response = self._first, self._response
        if not first:
            return self._balance.change(model, here, tool, load)
        near = self._balance.change(
            model, here[first // 3 :], tool, load[first:] - response.T @ load[:first]
        )
        if near is None:
            return None
        far = cho_solve((self._factor, False), load[:first], check_finite=False)
        return np.concatenate([-far - response @ near, near])


def _kept_nodes(model: BlockModel, near: IntArray) -> IntArray:
    """Nodes on which the body is condensed: those near the tool (k,) and more, so that the set
    seldom changes.
    """
    top, mesh = model.topology, model.mesh
    focus = mesh.near_focus[top.free[mesh.near_focus].all(axis=1)]
    if np.isin(near, focus).all():
        return focus
    rest = mesh.nodes[near]
    low = np.floor(rest.min(axis=0) / _CELL) * _CELL
    high = np.ceil(rest.max(axis=0) / _CELL) * _CELL
    surface = np.unique(top.surface)
    surface = surface[top.free[surface].all(axis=1)]
    inside = ((mesh.nodes[surface] >= low) & (mesh.nodes[surface] <= high)).all(axis=1)
    return np.union1d(near, surface[inside])
