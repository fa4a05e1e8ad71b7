"""Elastic energy of elements, its gradient and its tangent, for a modulus of one.

Each law is split into a part at each quadrature point and a volumetric part that sees the volume change only as the element's
pressures can follow it (see `core.fem.elements`), which keeps the elements free of volumetric locking up to nu = 0.49 and beyond.

neo_hooke     W = mu/2 x + kappa/4 (theta^2 - 1 - 2 ln theta), x = J^(-2/3) tr F^T F - 3, theta from J = det F
gent          as neo_hooke, with -mu J_m/2 ln(1 - x / J_m) instead of mu/2 x: no stretch takes x to J_m
corotational  W = mu |F - R|^2 + lambda/2 theta^2, theta from tr(R^T F) - 3, F = R S the polar decomposition
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

from core.fem import corotational, hyperelastic
from core.fem.elements import Quadrature
from core.frames import FloatArray
from core.mesh import IntArray
from core.setup import Material

__all__ = ["Law", "assemble_elastic", "elastic_energy", "lame"]


@dataclass(frozen=True)
class Law:
    """Which energy: `corotational` or not, and the strain stiffening 1 / J_m of Gent's law [1], zero without."""

    corotational: bool = False
    stiffening: float = 0.0

    @classmethod
    def of(cls, material: Material) -> Self:
        """The law of a material."""
        limit = material.stretch_limit
        return cls(material.law == "corotational", 0.0 if limit is None else 1.0 / limit)


def lame(law: Law, poisson_ratio: float) -> tuple[float, float]:
    """Shear modulus and volumetric stiffness (kappa, or lambda for the corotational law), both over E [1]."""
    mu = 0.5 / (1 + poisson_ratio)
    kappa = 1.0 / (3 * (1 - 2 * poisson_ratio))
    return mu, kappa - 2 * mu / 3 if law.corotational else kappa


def elastic_energy(law: Law, rule: Quadrature, nodes: IntArray, mu: FloatArray, bulk: FloatArray, positions: FloatArray) -> float:
    """Elastic energy over E [m^3]; infinite when an element is inverted at a quadrature point.

    Args:
        nodes: (e, a). mu, bulk: (e, q) moduli over E at the quadrature points. positions: (n, 3) current node positions [m].
    """
    parts = (rule.gradients, rule.weights, rule.pressures, nodes, mu, bulk)
    if law.corotational:
        return float(corotational.energy(*parts, positions))
    return float(hyperelastic.energy(*parts, law.stiffening, positions))


def assemble_elastic(
    law: Law,
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
    parts = (rule.gradients, rule.weights, rule.pressures, nodes, mu, bulk)
    if law.corotational:
        corotational.assemble(*parts, positions, slots, force, data)
        return
    hyperelastic.add_forces(*parts, law.stiffening, positions, force)
    if len(data):
        hyperelastic.add_matrices(*parts, law.stiffening, positions, slots, data)
