"""One step of a material's memory, linearised at its equilibrium and transposed: what the adjoint of a replay goes back through.

With h the history before a step (`core.memory.History`), u its equilibrium, X(u, h) the stress that it recalls and H(u, h) the
history after it, the adjoint needs the transposed derivatives of X and H by u and by h. All of them are of functions of a point's
own C and history, between linear maps to and from the grid. Those of C alone (the elastic law, the logarithm) are central
differences at the points, good to nine digits; everything else is exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from core.equilibrium import Equilibrium
from core.fem.memory import cauchy_green, from_log_strain, log_strain, shear_stress
from core.fem.model import BlockModel, rule_of
from core.fem.points import quadrature_tangents
from core.frames import FloatArray
from core.memory import History, Memory

__all__ = ["MemoryStep", "added", "nothing"]

_STEP = 1e-5
"""Of C [1] in central differences: their error is its square, and rounding over it."""
_FULL = np.array([[0, 5, 4], [5, 1, 3], [4, 3, 2]])
_TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
"""How often each component of a row (6,) is in the full tensor (3, 3)."""
_REMEMBERED = ("delayed", "driving", "largest", "kept", "free")


def nothing(history: History) -> History:
    """Costates of nothing yet: zeros in the shape of a history."""
    return replace(history, **{name: np.zeros_like(getattr(history, name)) for name in _REMEMBERED})


def added(one: History, other: History) -> History:
    """The sum of two costates."""
    return replace(one, **{name: getattr(one, name) + getattr(other, name) for name in _REMEMBERED})


def _slopes(function: Callable[[FloatArray], FloatArray], at: FloatArray) -> FloatArray:
    """Derivatives (m, 6, 6) of a function of rows (m, 6), point by point: the last index is the argument's."""
    found = np.empty((*at.shape, 6))
    for column, step in enumerate(_STEP * np.eye(6)):
        found[..., column] = (function(at + step) - function(at - step)) / (2 * _STEP)
    return found


def _pulled(slopes: FloatArray, costate: FloatArray) -> FloatArray:
    """Transposed slopes (m, 6, 6) times a costate (m, 6)."""
    return np.asarray(np.einsum("mij,mi->mj", slopes, costate))


def _stretched(tangents: FloatArray, change: FloatArray) -> FloatArray:
    """Change of C (..., 6) by a change (..., 3, 3) of the tangents, from which it is made."""
    products = change @ np.swapaxes(tangents, -1, -2)
    whole = products + np.swapaxes(products, -1, -2)
    return np.asarray(whole[..., (0, 1, 2, 1, 0, 0), (0, 1, 2, 2, 2, 1)])


def _stretched_transposed(tangents: FloatArray, costate: FloatArray) -> FloatArray:
    """From costates (..., 6) of C to those of the tangents (..., 3, 3)."""
    return np.asarray((costate[..., _FULL] * (1 + np.eye(3))) @ tangents)


class MemoryStep:
    """The step that a memory is in, linearised at a frame of it; `memory` still has the history from before.

    Costates are in the shape of a History; its time and touch are no part of them. `costate` is that after the step.
    """

    def __init__(self, memory: Memory, model: BlockModel, frame: Equilibrium, costate: History) -> None:
        self._memory, self._model, self._mesh, self._past = memory, model, frame.mesh, memory.history
        positions = frame.mesh.nodes + frame.displacement
        self._at_points, self._at_rule = memory.points.tangents(frame.mesh, positions), quadrature_tangents(frame.mesh, positions)
        strained, self._after, self._costate = cauchy_green(self._at_points), memory.after(frame), costate
        self._by_strain = _slopes(lambda c: shear_stress(memory.law, c), strained)
        self._linearise_set(strained, self._after)

    @property
    def symmetric(self) -> bool:
        """Whether the tangent is: no set grows."""
        return not len(self._growing)

    def _linearise_set(self, strained: FloatArray, after: History) -> None:
        """Slopes at the points whose set grows: L by C, and T by M."""
        memory = self._memory
        self._growing = np.flatnonzero(after.largest > self._past.largest)
        grown = strained[self._growing]
        self._strain, self._size = log_strain(grown), after.largest[self._growing, None]
        self._strain_by_c = _slopes(log_strain, grown)
        kept = after.kept[self._growing]
        self._free_by_kept = _slopes(lambda m: shear_stress(memory.law, from_log_strain(memory.fraction * m)), kept)

    def _through_set(self, costate: History) -> tuple[FloatArray, History]:
        """Costates of the set (largest, kept, free) after the step, as one of C (m, 6) and those of the set before it."""
        here, by_c = self._growing, np.zeros_like(costate.free)
        largest, kept, free = costate.largest.copy(), costate.kept.copy(), costate.free.copy()
        kept[here] += _pulled(self._free_by_kept, free[here])
        free[here] = 0.0
        share = self._past.largest[here, None] / self._size
        longest = self._strain * _TWICE / self._size
        along = (kept[here] * self._strain).sum(axis=1, keepdims=True) / self._size
        strain = (1 - share) * kept[here] + (share * along + largest[here, None]) * longest
        by_c[here] = _pulled(self._strain_by_c, strain)
        largest[here] = -along[:, 0]
        return by_c, replace(costate, largest=largest, kept=kept, free=free)

    def _on_strain(self, costate: FloatArray) -> FloatArray:
        """Costates of C (m, 6) on the nodes (n, 3)."""
        return self._memory.points.tangents_transposed(self._mesh, _stretched_transposed(self._at_points, costate))

    def recalled(self, adjoint: FloatArray) -> FloatArray:
        """Costate (m, 6) of the recalled stress X by an adjoint displacement (n, 3): of the residual's part H(X) : dC / 2."""
        change = _stretched(self._at_rule, quadrature_tangents(self._mesh, adjoint))
        scale = rule_of(self._mesh).weights * self._model.unrelaxed
        return self._memory.points.read_transposed(self._mesh, scale[..., None] * (0.5 * _TWICE) * change)

    def tangent(self, adjoint: FloatArray) -> FloatArray:
        """What the transposed tangent has beside the symmetric one, times an adjoint displacement (n, 3): the set's growth."""
        none = nothing(self._past)
        by_c, _ = self._through_set(replace(none, free=-self._memory.step.factor * self.recalled(adjoint)))
        return self._on_strain(by_c)

    @property
    def slope(self) -> FloatArray:
        """What the costate is by the displacements of its frame (n, 3)."""
        driven = self._driven()
        by_c, _ = self._through_set(replace(self._costate, free=self._costate.free - driven))
        return self._on_strain(by_c + _pulled(self._by_strain, driven))

    def agreement(self, history: History) -> float:
        """The costate times what another setup remembers beyond what is remembered here."""
        parts = ((getattr(each, name) for each in (self._costate, history, self._after)) for name in _REMEMBERED)
        return sum(float(np.vdot(costate, other - after)) for costate, other, after in parts)

    def _driven(self) -> FloatArray:
        """Costate (m, 6) of S - T after the step, by what is driven by it."""
        return np.asarray(self._costate.driving + np.einsum("k,kmc->mc", self._memory.step.taken, self._costate.delayed))

    def before(self, adjoint: FloatArray) -> History:
        """The costate before the step, with the adjoint displacement (n, 3) of its frame."""
        step, costate, recalled = self._memory.step, self._costate, self.recalled(adjoint)
        _, past = self._through_set(replace(costate, free=costate.free - self._driven() + step.factor * recalled))
        driving = step.taken.sum() * recalled - np.einsum("k,kmc->mc", step.taken, costate.delayed)
        return replace(past, delayed=step.left[:, None, None] * (costate.delayed - recalled), driving=driving)
