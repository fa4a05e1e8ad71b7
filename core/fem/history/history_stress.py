"""Constant stress over a time step, as a potential, and the shear stress that it comes from.

A second Piola-Kirchhoff stress H that does not change with the deformation has the energy density H
: (C - I) / 2, quadratic in the positions. So a time step of a material with history is one more
equilibrium (see `palpate.replay.material_history`), which every solver of equilibria can find. Its
tangent is H's geometric stiffness, constant over the step and in general indefinite.

Symmetric tensors are rows (6,) of xx, yy, zz, yz, xz, xy. Stresses are over the local shear
modulus, so that an inclusion's edge is in the modulus alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from numba import njit

from palpate.fem.constitutive.elastic import Law
from palpate.fem.constitutive.scatter import scatter
from palpate.fem.model import BlockModel
from palpate.fem.strain_tensors import invert
from palpate.foundation.arrays import FloatArray

__all__ = ["ConstantStress", "constant_stress_force", "shear_stress"]

_MOST_HARDENING = 50.0
"""Largest hardening [1]. Between quadrature points an element may be beyond Gent's limit although
it is not at them; there the stress stops growing."""


@njit(cache=True)
def _shear_stress(c: Any, stiffening: float, gamma: float, direction: Any) -> Any:
    result, inverse = np.empty(c.shape), np.empty(6)
    a0, a1 = direction[0], direction[1]
    for m in range(c.shape[0]):
        trace = c[m, 0] + c[m, 1] + c[m, 2]
        root = np.cbrt(invert(c[m], inverse))
        left = 1.0 - stiffening * (trace / root - 3.0)
        scale = min(1.0 / left, _MOST_HARDENING) / root if left > 0.0 else _MOST_HARDENING / root
        for k in range(6):
            result[m, k] = scale * ((1.0 if k < 3 else 0.0) - trace / 3.0 * inverse[k])
        if gamma > 0.0:
            pull = (
                2.0
                * gamma
                * (c[m, 0] * a0 * a0 + c[m, 1] * a1 * a1 + 2.0 * c[m, 5] * a0 * a1 - 1.0)
            )
            result[m, 0] += pull * a0 * a0
            result[m, 1] += pull * a1 * a1
            result[m, 5] += pull * a0 * a1
    return result


def shear_stress(law: Law, c: FloatArray) -> FloatArray:
    """Second Piola-Kirchhoff stress without the pressure, over the shear modulus (m, 6) [1].

    J^(-2/3) (I - tr C / 3 C^-1) / (1 - k x), k = 1 / J_m, and with fibres 2 gamma (I4 - 1) a a'.
    """
    return np.asarray(_shear_stress(c, law.stiffening, law.gamma, law.direction))


@njit(cache=True)
def _add(
    gradients: Any, weights: Any, nodes: Any, stress: Any, slots: Any, load: Any, data: Any
) -> None:
    """Subtract the forces at rest from `load` and add the tangent to `data`.

    Args:
        gradients: (e, q, a, 3) [1/m].
        weights: (e, q) [m^3].
        nodes: (e, a).
        stress: (e, q, 6) over E [1].
        slots: as in `assemble_elastic`.
        load: (n, 3) [m^2].
        data: [m].
    """
    corners = nodes.shape[1]
    matrix, pulled = np.empty((3 * corners, 3 * corners)), np.empty((corners, 3))
    for e in range(nodes.shape[0]):
        matrix[:] = 0.0
        for q in range(weights.shape[1]):
            g, h, w = gradients[e, q], stress[e, q], weights[e, q]
            for a in range(corners):
                pulled[a, 0] = w * (h[0] * g[a, 0] + h[5] * g[a, 1] + h[4] * g[a, 2])
                pulled[a, 1] = w * (h[5] * g[a, 0] + h[1] * g[a, 1] + h[3] * g[a, 2])
                pulled[a, 2] = w * (h[4] * g[a, 0] + h[3] * g[a, 1] + h[2] * g[a, 2])
                for i in range(3):
                    load[nodes[e, a], i] -= pulled[a, i]
            for a in range(corners):
                for b in range(a, corners):
                    share = pulled[a, 0] * g[b, 0] + pulled[a, 1] * g[b, 1] + pulled[a, 2] * g[b, 2]
                    for i in range(3):
                        matrix[3 * a + i, 3 * b + i] += share
        scatter(matrix, slots[e], data)


@njit(cache=True)
def _add_force(
    gradients: Any, weights: Any, nodes: Any, stress: Any, displacement: Any, force: Any
) -> None:
    """Add the forces of the stress at a displacement to `force` (n, 3) [m^2].

    Args:
        gradients: (e, q, a, 3) [1/m].
        weights: (e, q) [m^3].
        nodes: (e, a).
        stress: (e, q, 6) over E [1].
        displacement: (n, 3) [m].
        force: to be added to.
    """
    corners = nodes.shape[1]
    f, pulled = np.empty((3, 3)), np.empty((3, 3))
    for e in range(nodes.shape[0]):
        for q in range(weights.shape[1]):
            g, h, w = gradients[e, q], stress[e, q], weights[e, q]
            for i in range(3):
                for k in range(3):
                    f[i, k] = 1.0 if i == k else 0.0
            for a in range(corners):
                for i in range(3):
                    moved = displacement[nodes[e, a], i]
                    for k in range(3):
                        f[i, k] += moved * g[a, k]
            for i in range(3):
                pulled[i, 0] = w * (f[i, 0] * h[0] + f[i, 1] * h[5] + f[i, 2] * h[4])
                pulled[i, 1] = w * (f[i, 0] * h[5] + f[i, 1] * h[1] + f[i, 2] * h[3])
                pulled[i, 2] = w * (f[i, 0] * h[4] + f[i, 1] * h[3] + f[i, 2] * h[2])
            for a in range(corners):
                for i in range(3):
                    force[nodes[e, a], i] += (
                        pulled[i, 0] * g[a, 0] + pulled[i, 1] * g[a, 1] + pulled[i, 2] * g[a, 2]
                    )


def constant_stress_force(
    model: BlockModel, stress: FloatArray, displacement: FloatArray
) -> FloatArray:
    """Return the force of a constant stress on the unknowns over E (u,) [m^2].

    It is `ConstantStress.force`, without the stiffness that a solver needs.

    Args:
        model: with the mesh.
        stress: over E (e, q, 6) [1] at its quadrature points.
        displacement: of the nodes (n, 3) [m].
    """
    force = np.zeros_like(model.mesh.nodes)
    rule, elements = model.rule, model.topology.elements
    _add_force(rule.gradients, rule.weights, elements, stress, displacement, force)
    return np.asarray(force[model.topology.free])


@dataclass(frozen=True, eq=False)
class ConstantStress:
    """Energy H : (C - I) / 2 over the body as a quadratic form of the unknowns' displacements d
    (u,).

    It is 1/2 d' Q d - b' d, over E.

    Attributes:
        upper: upper triangle and diagonal of Q [m].
        data: its entries in the tangent's pattern.
        load: b (u,) [m^2].
    """

    upper: sp.csr_matrix
    data: FloatArray
    load: FloatArray

    @classmethod
    def of(cls, model: BlockModel, stress: FloatArray) -> Self:
        """Make the potential of the stress H over E (e, q, 6) [1] at the model's quadrature
        points.
        """
        top = model.topology
        load, data = np.zeros_like(model.mesh.nodes), np.zeros(top.pattern.nnz)
        _add(model.rule.gradients, model.rule.weights, top.elements, stress, top.slots, load, data)
        upper = sp.csr_matrix(
            (data, top.pattern.indices, top.pattern.indptr), shape=top.pattern.shape
        )
        return cls(upper, data, load[top.free])

    @cached_property
    def _diagonal(self) -> FloatArray:
        return np.asarray(self.upper.diagonal())

    def _turned(self, displacement: FloatArray) -> FloatArray:
        whole = (
            self.upper @ displacement + self.upper.T @ displacement - self._diagonal * displacement
        )
        return np.asarray(whole)

    def energy(self, displacement: FloatArray) -> float:
        """Energy over E [m^3]."""
        return float(displacement @ (0.5 * self._turned(displacement) - self.load))

    def force(self, displacement: FloatArray) -> FloatArray:
        """Gradient of the energy over E (u,) [m^2]."""
        return np.asarray(self._turned(displacement) - self.load)
