"""The transposed tangent of an equilibrium: a symmetric part, which has a factor, and what makes it unsymmetric beside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from scipy.sparse.linalg import LinearOperator, gmres

from core.errors import SolveError
from core.fem.model import BlockModel, Probe
from core.frames import FloatArray

__all__ = ["Beside", "TransposedTangent"]

_TOLERANCE, _RESTART, _MOST_TURNS = 1e-11, 50, 200


class Beside(Protocol):
    """A part of the tangent that the model does not assemble."""

    def tangent(self, adjoint: FloatArray) -> FloatArray:
        """Its transpose times an adjoint displacement (n, 3), over E."""


class TransposedTangent:
    """At positions (n, 3) [m] of a model, with the tool at `probe`; raises NotPositiveDefinite when the model's part has no factor.

    With other parts beside it is solved by GMRES, preconditioned by that factor: the set that grows, and pressure and friction that
    follow each other, are found by few turns of plain equilibria, and so is this.
    """

    def __init__(self, model: BlockModel, positions: FloatArray, probe: Probe, beside: Sequence[Beside]) -> None:
        self._top, self._beside = model.topology, beside
        model.factorise(model.assemble(positions, probe).data)

    def field(self, free: FloatArray) -> FloatArray:
        """Unknowns (u,) at the nodes (n, 3)."""
        found = np.zeros(self._top.free.shape)
        found[self._top.free] = free
        return found

    def _turned(self, free: FloatArray) -> FloatArray:
        """Times the tangent, divided by its symmetric part."""
        field = self.field(free)
        more = sum((part.tangent(field) for part in self._beside), np.zeros_like(field))
        return free + self._top.factor.solve(more[self._top.free])

    def solve(self, right: FloatArray) -> FloatArray:
        """For one (u,) or several (u, m) right sides."""
        near = self._top.factor.solve(right)
        if not self._beside or not right.any():
            return near
        if right.ndim == 2:
            return np.stack([self.solve(column) for column in right.T], axis=1)
        operator = LinearOperator((len(right), len(right)), matvec=self._turned, dtype=float)
        found, missed = gmres(operator, near, x0=near, rtol=_TOLERANCE, atol=0.0, restart=_RESTART, maxiter=_MOST_TURNS)
        if missed:
            raise SolveError("the adjoint of a frame with friction, or in which a set grows, was not found")
        return np.asarray(found)
