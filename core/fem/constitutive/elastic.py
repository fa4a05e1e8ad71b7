"""Elastic energy of elements, its gradient and its tangent, for a modulus of one.

Each law is split into a part at each quadrature point and a volumetric part that depends on the
volume change only as far as the element's pressures can represent it (see `palpate.mesh.elements`).
That keeps the elements free of volumetric locking up to nu = 0.49 and beyond.

- neo_hooke: W = mu/2 x + kappa/4 (theta^2 - 1 - 2 ln theta), with x = J^(-2/3) tr F^T F - 3 and
theta from J = det F.
- gent: as neo_hooke, with -mu J_m/2 ln(1 - x / J_m) instead of mu/2 x; no stretch takes x to J_m.
- corotational: W = mu |F - R|^2 + lambda/2 theta^2, with theta from tr(R^T F) - 3 and F = R S the
polar decomposition.
- fibres, added to any of them: mu gamma/2 (|F a|^2 - 1)^2, with a along the fibres.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from palpate.fem.constitutive import corotational, fibres, hyperelastic, hyperelastic_tangent
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.elements import Quadrature
from palpate.setup.setup import Material

__all__ = ["Law", "assemble_elastic", "elastic_energy", "lame", "reinforcement"]


@dataclass(frozen=True)
class Law:
    """An elastic law.

    Attributes:
        corotational: instead of hyperelastic.
        stiffening: 1 / J_m of Gent's law [1], zero for neo-Hooke.
        gamma: stiffness of the fibres over the shear modulus [1], zero without fibres.
        angle: of the fibres from the x axis [rad].
    """

    corotational: bool = False
    stiffening: float = 0.0
    gamma: float = 0.0
    angle: float = 0.0

    @classmethod
    def of(cls, material: Material) -> Self:
        """The law of a material."""
        limit, along = material.stretch_limit, material.fibres
        return cls(
            material.law == "corotational",
            0.0 if limit is None else 1.0 / limit,
            0.0 if along is None else reinforcement(along.stiffness_ratio, material.poisson_ratio),
            0.0 if along is None else along.direction,
        )

    @property
    def direction(self) -> FloatArray:
        """Unit vector (3,) along the fibres."""
        return np.array([np.cos(self.angle), np.sin(self.angle), 0.0])


def reinforcement(stiffness_ratio: float, poisson_ratio: float) -> float:
    """The fibres' gamma [1] for a ratio of Young's moduli along and across the fibres, at small
    strain.

    Along: E_a = E + 4 gamma mu. Across, where the fibres hinder the contraction: E / E_c = 1 - nu^2
    (1 - E / E_a).
    """
    along = 1 + (stiffness_ratio - 1) / (1 - poisson_ratio**2)
    return (along - 1) * (1 + poisson_ratio) / 2


def lame(law: Law, poisson_ratio: float) -> tuple[float, float]:
    """Shear modulus and volumetric modulus over E [1].

    The volumetric one is kappa, or lambda for the corotational law.
    """
    mu = 0.5 / (1 + poisson_ratio)
    kappa = 1.0 / (3 * (1 - 2 * poisson_ratio))
    return mu, kappa - 2 * mu / 3 if law.corotational else kappa


def elastic_energy(
    law: Law,
    rule: Quadrature,
    nodes: IntArray,
    mu: FloatArray,
    bulk: FloatArray,
    positions: FloatArray,
) -> float:
    """Elastic energy over E [m^3]; infinite if an element is inverted at a quadrature point.

    Args:
        law: of elasticity.
        rule: quadrature of the mesh.
        nodes: (e, a).
        mu: (e, q) shear modulus over E.
        bulk: (e, q) volumetric modulus over E.
        positions: (n, 3) current node positions [m].
    """
    parts = (rule.weights, rule.pressures, nodes, mu, bulk)
    if law.corotational:
        total = float(corotational.energy(rule.gradients, *parts, positions))
    else:
        total = float(hyperelastic.energy(rule.slopes, *parts, law.stiffening, positions))
    if law.gamma:
        total += float(
            fibres.energy(
                rule.gradients, rule.weights, nodes, law.gamma * mu, law.direction, positions
            )
        )
    return total


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
    """Add the energy's gradient and, if `data` is not empty, its tangent.

    Elements must not be inverted. Args as in `elastic_energy`, and:
        slots: (e, 3 a, 3 a) index into `data` of each entry of an element's matrix; -1 drops it (a
            constrained unknown, or below the diagonal of the symmetric matrix).
        force: (n, 3) the gradient over E is added here [m^2].
        data: the tangent over E is added here [m].
    """
    parts = (rule.weights, rule.pressures, nodes, mu, bulk)
    if law.gamma:
        along = (rule.gradients, rule.weights, nodes, law.gamma * mu, law.direction, positions)
        fibres.add_forces(*along, force)
        if len(data):
            fibres.add_matrices(*along, slots, data)
    if law.corotational:
        corotational.assemble(rule.gradients, *parts, positions, slots, force, data)
        return
    hyperelastic.add_forces(rule.slopes, *parts, law.stiffening, positions, force)
    if len(data):
        hyperelastic_tangent.add_matrices(
            rule.slopes, *parts, law.stiffening, positions, slots, data
        )
