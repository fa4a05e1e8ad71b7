"""Coulomb friction between the virtual tool and the block, as an incremental potential.

From one tool position to the next the surface slips against the tool (Ortiz and Stainier 1999). The
potential per surface point is mu p A (sqrt(d^2 + e^2) - e), with d the tangential way of the point
against the tool since first contact or since the last position. Slip is dissipated in full, and
sticking points creep by about e. Pressure p and normals are those of the previous iterate and are
updated until they converge, while e is reduced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.solver.mooney_rivlin import spread
from palpate.synthetic.solver.obstacles import SOFT_GAP
from palpate.synthetic.solver.tet_block import IntArray, TetBlock

__all__ = ["CoulombFriction", "FrictionContact", "assemble_friction"]

CREEPS = (1e-4, 3e-5, 1e-5, 4e-6)
"""Regularisation length e [m] of each iteration; the last one is kept."""
_AGREED, _GOOD_ENOUGH, _MOST_TURNS = 0.01, 0.05, 20
"""Relative change of the friction limits at which pressure and friction have converged [1], the
same after the last iteration, and the number of iterations."""


@dataclass(frozen=True, eq=False)
class FrictionContact:
    """Friction of one iteration, on the facets of the skin that touch the tool.

    Attributes:
        facets: (f,) their numbers.
        owner: (f,) their elements.
        values: (f, q, 10) shape functions.
        limits: (f, q) mu p A [N].
        normals: (f, q, 3) unit normals away from the tool.
        before: (f, q, 3) start of the way d, relative to the tool's centre [m].
        creep: e [m].
    """

    facets: IntArray
    owner: IntArray
    values: FloatArray
    limits: FloatArray
    normals: FloatArray
    before: FloatArray
    creep: float


@dataclass(frozen=True, eq=False)
class _SkinView:
    """The skin relative to the tool.

    Attributes:
        places: (f, q, 3) relative to the tool's centre [m].
        depth: (f, q) penetration of the tool [m].
    """

    places: FloatArray
    depth: FloatArray


class CoulombFriction:
    """Friction of one tool on one block, from one tool position to the next.

    Args:
        block: the mesh.
        friction: largest tangential stress [Pa] at pressures [Pa].
        radius: of the tool [m].
        penalty: of the contact [Pa/m].
    """

    def __init__(
        self,
        block: TetBlock,
        friction: Callable[[FloatArray], FloatArray],
        radius: float,
        penalty: float,
    ) -> None:
        self._block, self._friction, self._radius, self._penalty = block, friction, radius, penalty
        self._last: _SkinView | None = None

    def finish_step(self, displacement: FloatArray, centre: FloatArray) -> None:
        """Store the end of a step: displacement (n, 3) [m] and tool centre (3,) [m] in the block's
        frame.
        """
        self._last = self._skin_view(displacement, centre)

    def solve(
        self, centre: FloatArray, solve: Callable[[FrictionContact | None], FloatArray]
    ) -> None:
        """Solve for the equilibrium until pressure and friction agree; SolveError if they do not.

        Args:
            centre: (3,) of the tool [m].
            solve: the displacement (n, 3) [m] under a given friction.
        """
        before = self._last
        # The first iterate lets sticking points move with the tool.
        seen = (
            before
            if before is not None and (before.depth > 0).any()
            else self._skin_view(solve(None), centre)
        )
        friction_contact, change, share = self._contact(seen, 0), np.inf, 1.0
        for turn in range(_MOST_TURNS):
            if friction_contact is None:
                return
            seen = self._skin_view(solve(friction_contact), centre)
            renewed = self._contact(seen, turn + 1)
            last, change = change, self._change(friction_contact, renewed)
            if change < _AGREED and turn + 1 >= len(CREEPS):
                return
            # Under-relaxation where pressure and friction oscillate.
            share = (
                max(0.5 * share, 0.1)
                if change > last and turn >= len(CREEPS)
                else min(1.5 * share, 1.0)
            )
            friction_contact = self._mixed(friction_contact, renewed, share)
        if change > _GOOD_ENOUGH:
            raise SolveError(
                "friction and pressure of the virtual tool find no agreement: they are "
                f"{100 * change:.0f} % apart",
                residual=change,
            )

    def _mixed(
        self, old: FrictionContact, new: FrictionContact | None, share: float
    ) -> FrictionContact | None:
        """The new friction with limits interpolated from the old ones by `share` [1]."""
        if new is None or share == 1.0:
            return new
        limits = np.zeros(self._block.skin.weights.shape)
        limits[old.facets] = old.limits
        return replace(new, limits=share * new.limits + (1 - share) * limits[new.facets])

    def _change(self, before: FrictionContact, now: FrictionContact | None) -> float:
        """Relative change of the friction limits [1]."""
        limits = np.zeros((2, *self._block.skin.weights.shape))
        for place, friction_contact in zip(limits, (before, now), strict=True):
            if friction_contact is not None:
                place[friction_contact.facets] = friction_contact.limits
        return float(np.abs(limits[1] - limits[0]).sum() / max(limits[1].sum(), 1e-300))

    def _skin_view(self, displacement: FloatArray, centre: FloatArray) -> _SkinView:
        skin = self._block.skin
        nodes = (self._block.nodes + displacement)[self._block.elements[skin.owner]]
        places = np.einsum("fqa,fai->fqi", skin.values, nodes) - centre
        return _SkinView(places, self._radius - np.linalg.norm(places, axis=2))

    def _contact(self, now: _SkinView, turn: int) -> FrictionContact | None:
        """Friction on the facets that touch now; None without contact."""
        facets = np.flatnonzero((now.depth > 0).any(axis=1))
        if not len(facets):
            return None
        skin, last = self._block.skin, self._last or now
        places, depth = now.places[facets], np.maximum(now.depth[facets], 0.0)
        pressure = self._penalty * np.where(
            depth < SOFT_GAP, 0.5 * depth**2 / SOFT_GAP, depth - 0.5 * SOFT_GAP
        )
        # For a new contact point the way d starts where the point met the tool.
        apart = np.maximum(-last.depth[facets], 0.0)
        met = (apart / np.maximum(apart + depth, 1e-12))[..., None]
        before = last.places[facets] + met * (places - last.places[facets])
        normals = places / np.linalg.norm(places, axis=2, keepdims=True)
        limits = self._friction(pressure) * skin.weights[facets]
        creep = CREEPS[min(turn, len(CREEPS) - 1)]
        return FrictionContact(
            facets,
            skin.owner[facets],
            np.ascontiguousarray(skin.values[facets]),
            limits,
            normals,
            before,
            creep,
        )


@njit(cache=True, fastmath={"contract", "reassoc", "arcp", "nsz"})
def assemble_friction(
    u: Any,
    nodes: Any,
    elements: Any,
    owner: Any,
    values: Any,
    limits: Any,
    normals: Any,
    before: Any,
    creep: float,
    centre: Any,
    derivative: bool,
    stiffness: Any,
    force: Any,
    tool_force: Any,
    coupling: Any,
    total: Any,
) -> float:
    """Energy [J] of a `FrictionContact` at displacements u (n, 3) [m].

    With `derivative`, adds to the arrays that `palpate.synthetic.solver.obstacles` documents.
    """
    energy = 0.0
    way = np.empty(3)
    pull = np.empty(3)
    t = np.empty((3, 3))
    for s in range(owner.shape[0]):
        element = elements[owner[s]]
        for q in range(limits.shape[1]):
            limit = limits[s, q]
            if limit <= 0.0:
                continue
            n = normals[s, q]
            along = 0.0
            for i in range(3):
                way[i] = -centre[i] - before[s, q, i]
                for a in range(10):
                    way[i] += values[s, q, a] * (nodes[element[a], i] + u[element[a], i])
                along += way[i] * n[i]
            length = creep * creep
            for i in range(3):
                way[i] -= along * n[i]
                length += way[i] * way[i]
            length = np.sqrt(length)
            energy += limit * (length - creep)
            if not derivative:
                continue
            for i in range(3):
                pull[i] = limit / length * way[i]
                tool_force[i] -= pull[i]
                for k in range(3):
                    across = (
                        (1.0 if i == k else 0.0) - n[i] * n[k] - way[i] * way[k] / (length * length)
                    )
                    t[i, k] = limit / length * across
                    total[i, k] += t[i, k]
            spread(values[s, q], element, pull, t, stiffness[owner[s]], force, coupling)
    return energy
