"""Coulomb's friction between the virtual tool and the block: from one place of the tool to the next
the surface slips against it, and what that costs is the energy of an incremental potential (Ortiz
and Stainier 1999).

Per surface point it is mu p A (sqrt(d^2 + e^2) - e), d the point's tangential way against the tool
since it was touched, or since the last place; so slip is paid in full, and what sticks creeps by
about e. Pressure and normals are those of the equilibrium before and are renewed until they stay; e
is lessened on the way there.
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
from palpate.synthetic.solver.tet_block import Block, IntArray

__all__ = ["Dragging", "Rub", "assemble_rub"]

CREEPS = (1e-4, 3e-5, 1e-5, 4e-6)
"""e [m], in turn; the last one stays."""
_AGREED, _GOOD_ENOUGH, _MOST_TURNS = 0.01, 0.05, 20
"""Change of what friction holds, over all of it [1], at which pressure and friction agree; the same
where turns have run out."""


@dataclass(frozen=True, eq=False)
class Rub:
    """What friction holds while one equilibrium is sought, on those facets of the skin that touch.

    Attributes:
        facets: (f,) their numbers.
        owner: (f,) elements.
        values: (f, q, 10) shape functions.
        limits: (f, q) mu p A [N].
        normals: (f, q, 3) from the tool.
        before: (f, q, 3) from where the way d is counted, seen from the tool's centre [m].
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
class _Seen:
    """The skin from the tool's centre: places (f, q, 3) [m], depth in the tool (f, q) [m]."""

    places: FloatArray
    depth: FloatArray


class Dragging:
    """Friction of one tool on one block, from place to place.

    Args:
        friction: coefficient [1].
        radius: of the tool [m].
        penalty: of the contact [Pa/m].
    """

    def __init__(self, block: Block, friction: float, radius: float, penalty: float) -> None:
        self._block, self._friction, self._radius, self._penalty = block, friction, radius, penalty
        self._last: _Seen | None = None

    def leave(self, displacement: FloatArray, centre: FloatArray) -> None:
        """The step is over: with this displacement (n, 3) and the tool here (3,) [m], seen from the
        block.
        """
        self._last = self._seen(displacement, centre)

    def found(self, centre: FloatArray, solve: Callable[[Rub | None], FloatArray]) -> None:
        """Have the equilibrium sought with friction until pressure and friction agree.

        Args:
            centre: of the tool (3,) [m].
            solve: the displacement (n, 3) [m] under a given friction.

        Raises SolveError where they never do.
        """
        before = self._last
        # What stuck before sticks first: the tool takes it along.
        seen = (
            before
            if before is not None and (before.depth > 0).any()
            else self._seen(solve(None), centre)
        )
        rub, change, share = self._rub(seen, 0), np.inf, 1.0
        for turn in range(_MOST_TURNS):
            if rub is None:
                return
            seen = self._seen(solve(rub), centre)
            renewed = self._rub(seen, turn + 1)
            last, change = change, self._change(rub, renewed)
            if change < _AGREED and turn + 1 >= len(CREEPS):
                return
            # Where pressure and friction drive one another to and fro they go only part of the way.
            share = (
                max(0.5 * share, 0.1)
                if change > last and turn >= len(CREEPS)
                else min(1.5 * share, 1.0)
            )
            rub = self._mixed(rub, renewed, share)
        if change > _GOOD_ENOUGH:
            text = f"friction and pressure of the virtual tool find no agreement: they are {100 * change:.0f} % apart"
            raise SolveError(text, residual=change)

    def _mixed(self, old: Rub, new: Rub | None, share: float) -> Rub | None:
        """The new one, with limits only this share [1] of the way from the old ones'."""
        if new is None or share == 1.0:
            return new
        limits = np.zeros(self._block.skin.weights.shape)
        limits[old.facets] = old.limits
        return replace(new, limits=share * new.limits + (1 - share) * limits[new.facets])

    def _change(self, before: Rub, now: Rub | None) -> float:
        """How much of what was held is held otherwise [1]."""
        limits = np.zeros((2, *self._block.skin.weights.shape))
        for place, rub in zip(limits, (before, now), strict=True):
            if rub is not None:
                place[rub.facets] = rub.limits
        return float(np.abs(limits[1] - limits[0]).sum() / max(limits[1].sum(), 1e-300))

    def _seen(self, displacement: FloatArray, centre: FloatArray) -> _Seen:
        skin = self._block.skin
        nodes = (self._block.nodes + displacement)[self._block.elements[skin.owner]]
        places = np.einsum("fqa,fai->fqi", skin.values, nodes) - centre
        return _Seen(places, self._radius - np.linalg.norm(places, axis=2))

    def _rub(self, now: _Seen, turn: int) -> Rub | None:
        """Of the facets that touch now; None where none does."""
        facets = np.flatnonzero((now.depth > 0).any(axis=1))
        if not len(facets):
            return None
        skin, last = self._block.skin, self._last or now
        places, depth = now.places[facets], np.maximum(now.depth[facets], 0.0)
        pressure = self._penalty * np.where(
            depth < SOFT_GAP, 0.5 * depth**2 / SOFT_GAP, depth - 0.5 * SOFT_GAP
        )
        # A point that was not touched before is dragged from where it met the tool.
        apart = np.maximum(-last.depth[facets], 0.0)
        met = (apart / np.maximum(apart + depth, 1e-12))[..., None]
        before = last.places[facets] + met * (places - last.places[facets])
        normals = places / np.linalg.norm(places, axis=2, keepdims=True)
        limits = self._friction * pressure * skin.weights[facets]
        creep = CREEPS[min(turn, len(CREEPS) - 1)]
        return Rub(
            facets,
            skin.owner[facets],
            np.ascontiguousarray(skin.values[facets]),
            limits,
            normals,
            before,
            creep,
        )


@njit(cache=True, fastmath={"contract", "reassoc", "arcp", "nsz"})
def assemble_rub(
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
    push: Any,
    coupling: Any,
    total: Any,
) -> float:
    """Energy [J] of a `Rub` at displacements u (n, 3) [m]; with `derivative`, adds what
    `obstacle.assemble_obstacle` adds.
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
                push[i] -= pull[i]
                for k in range(3):
                    across = (
                        (1.0 if i == k else 0.0) - n[i] * n[k] - way[i] * way[k] / (length * length)
                    )
                    t[i, k] = limit / length * across
                    total[i, k] += t[i, k]
            spread(values[s, q], element, pull, t, stiffness[owner[s]], force, coupling)
    return energy
