"""Elastic energy of elements, its gradient and its tangent, for a modulus of one.

Each law is split into a part at each quadrature point and a volumetric part that sees the volume change only as the element's
pressures can follow it (see `core.fem.elements`), which keeps the elements free of volumetric locking up to nu = 0.49 and beyond.

neo_hooke     W = mu/2 (J^(-2/3) tr F^T F - 3) + kappa/4 (theta^2 - 1 - 2 ln theta), theta from J = det F
corotational  W = mu |F - R|^2 + lambda/2 theta^2, theta from tr(R^T F) - 3, F = R S the polar decomposition
"""

from __future__ import annotations

from core.fem import corotational, hyperelastic
from core.fem.elements import Quadrature
from core.frames import FloatArray
from core.mesh import IntArray

__all__ = ["LAWS", "assemble_elastic", "elastic_energy", "lame"]

LAWS = {"neo_hooke": 0, "corotational": 1}


def lame(law: str, poisson_ratio: float) -> tuple[float, float]:
    """Shear modulus and volumetric stiffness (kappa, or lambda for the corotational law), both over E [1]."""
    mu = 0.5 / (1 + poisson_ratio)
    kappa = 1.0 / (3 * (1 - 2 * poisson_ratio))
    return mu, kappa if law == "neo_hooke" else kappa - 2 * mu / 3


def elastic_energy(law: int, rule: Quadrature, nodes: IntArray, mu: FloatArray, bulk: FloatArray, positions: FloatArray) -> float:
    """Elastic energy over E [m^3]; infinite when an element is inverted at a quadrature point.

    Args:
        law: see LAWS. nodes: (e, a). mu, bulk: (e,) moduli over E. positions: (n, 3) current node positions [m].
    """
    kernels = hyperelastic if law == LAWS["neo_hooke"] else corotational
    return float(kernels.energy(rule.gradients, rule.weights, rule.pressures, nodes, mu, bulk, positions))


def assemble_elastic(
    law: int,
    rule: Quadrature,
    nodes: IntArray,
    mu: FloatArray,
    bulk: FloatArray,
    positions: FloatArray,
    slots: IntArray,
    force: FloatArray,
    data: FloatArray,
) -> None:
    """Add the energy's gradient over E to `force` (n, 3) [m^2] and, if `data` is not empty, its tangent [m] to it.

    `slots` (e, 3 a, 3 a) says where in `data` an entry of the element's matrix goes; -1 drops it (constrained, or below the
    diagonal of the symmetric matrix). Elements must not be inverted. Other arguments as in `elastic_energy`.
    """
    parts = (rule.gradients, rule.weights, rule.pressures, nodes, mu, bulk, positions)
    if law != LAWS["neo_hooke"]:
        corotational.assemble(*parts, slots, force, data)
        return
    hyperelastic.add_forces(*parts, force)
    if len(data):
        hyperelastic.add_matrices(*parts, slots, data)
