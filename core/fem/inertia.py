"""Inertia and Rayleigh damping as a potential: what implicit Euler adds to the energy of one step.

With M the mass, C = alpha M + beta K_0 (K_0 the stiffness at rest) and h the step, x_1 = x_0 + h v_1 makes stationary

    W(x) + 1/2 (x - x_0 - h v_0)' M/h^2 (x - x_0 - h v_0) + 1/2 (x - x_0)' C/h (x - x_0)

(e.g. Martin et al. 2011), so that a step is one more equilibrium, and all that finds equilibria finds it. All over E.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from core.fem.model import BlockModel
from core.frames import FloatArray

__all__ = ["Damping", "Inertia", "Step"]


@dataclass(frozen=True)
class Damping:
    """Rayleigh's: C = mass M + stiffness K_0, in 1/s and s."""

    mass: float = 0.0
    stiffness: float = 0.0


@dataclass(frozen=True, eq=False)
class Step:
    """1/2 d' Q d - b' d of the unknowns' displacements d (u,); `data` are Q's entries in the tangent's pattern over E [m]."""

    matrix: sp.csr_matrix
    data: FloatArray
    load: FloatArray

    def energy(self, displacement: FloatArray) -> float:
        """Over E [m^3]."""
        return float(displacement @ (0.5 * (self.matrix @ displacement) - self.load))

    def force(self, displacement: FloatArray) -> FloatArray:
        """Its gradient over E (u,) [m^2]."""
        return np.asarray(self.matrix @ displacement - self.load)


class Inertia:
    """Mass and damping of a block of this density [kg/m^3] on the model's mesh; `step` makes what one step adds."""

    def __init__(self, model: BlockModel, density: float, damping: Damping) -> None:
        self._model, self._damping = model, damping
        self._mass = density / model.setup.material.young_modulus * self._unit_mass()
        self._stiffness = model.assemble(model.mesh.nodes, None).data
        self._whole_of: tuple[float, FloatArray, sp.csr_matrix, sp.csr_matrix] | None = None

    def _unit_mass(self) -> FloatArray:
        """Consistent mass for a density of one, in the tangent's pattern [m^3]."""
        top, shapes = self._model.topology, self._model.topology.element.shapes
        own = np.einsum("eq,qa,qb->eab", self._model.rule.weights, shapes, shapes)
        size = 3 * shapes.shape[1]
        blocks = np.einsum("eab,ij->eaibj", own, np.eye(3)).reshape(len(own), size, size)
        data, used = np.zeros(top.pattern.nnz), top.slots >= 0
        np.add.at(data, top.slots[used], blocks[used])
        return data

    def _whole(self, data: FloatArray) -> sp.csr_matrix:
        pattern = self._model.topology.pattern
        upper = sp.csr_matrix((data, pattern.indices, pattern.indptr), shape=pattern.shape)
        return sp.csr_matrix(upper + upper.T - sp.diags(upper.diagonal()))

    def step(self, seconds: float, displacement: FloatArray, velocity: FloatArray) -> Step:
        """What is added while the unknowns go on from this displacement [m] and velocity [m/s] (u,) for some seconds."""
        if self._whole_of is None or self._whole_of[0] != seconds:
            moved = self._mass / seconds**2
            damped = (self._damping.mass * self._mass + self._damping.stiffness * self._stiffness) / seconds
            self._whole_of = seconds, moved + damped, self._whole(moved), self._whole(damped)
        _, data, mass, damping = self._whole_of
        return Step(mass + damping, data, mass @ (displacement + seconds * velocity) + damping @ displacement)
