"""Elastic energy of hexahedra, its gradient and its tangent, for a modulus of one.

Both laws are split into a part at each quadrature point and a volumetric part that sees only the element's mean volume change
(mean dilatation: Nagtegaal, Parks and Rice 1974; Simo, Taylor and Pister 1985), which keeps trilinear elements free of
volumetric locking up to nu = 0.49 and beyond.

neo_hooke     W = mu/2 (J^(-2/3) tr F^T F - 3) + kappa/4 (theta^2 - 1 - 2 ln theta), theta = mean of J = det F
corotational  W = mu |F - R|^2 + lambda/2 theta^2, theta = mean of tr(R^T F) - 3, F = R S the polar decomposition
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from core.fem import corotational, neo_hooke
from core.frames import FloatArray

__all__ = ["CORNERS", "LAWS", "assemble_elastic", "elastic_energy", "gauss_gradients", "lame"]

LAWS = {"neo_hooke": 0, "corotational": 1}
CORNERS = np.array([[dx, dy, dz] for dz in (-1, 1) for dy in (-1, 1) for dx in (-1, 1)], dtype=float)


def lame(law: str, poisson_ratio: float) -> tuple[float, float]:
    """Shear modulus and volumetric stiffness (kappa, or lambda for the corotational law), both over E [1]."""
    mu = 0.5 / (1 + poisson_ratio)
    kappa = 1.0 / (3 * (1 - 2 * poisson_ratio))
    return mu, kappa if law == "neo_hooke" else kappa - 2 * mu / 3


def gauss_gradients(corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gradients of the trilinear shape functions and weights at the 2x2x2 Gauss points.

    Args:
        corners: (e, 8, 3) rest positions of the elements' nodes [m].

    Returns:
        (e, 8, 8, 3) gradients [1/m] by element, point, node, axis; (e, 8) weights [m^3].
    """
    points = CORNERS / math.sqrt(3)
    reference = np.empty((8, 8, 3))
    for axis in range(3):
        others = [a for a in range(3) if a != axis]
        along = (1 + points[:, None, others] * CORNERS[None, :, others]) / 2
        reference[:, :, axis] = CORNERS[None, :, axis] / 2 * along.prod(axis=2)
    jacobian = np.einsum("qai,eaj->eqij", reference, corners)
    gradients = np.einsum("eqij,qaj->eqai", np.linalg.inv(jacobian), reference)
    return np.ascontiguousarray(gradients), np.ascontiguousarray(np.linalg.det(jacobian))


def elastic_energy(law: int, gradients: Any, weights: Any, nodes: Any, mu: Any, bulk: Any, positions: Any) -> float:
    """Elastic energy over E [m^3]; infinite when an element is inverted at a quadrature point.

    Args:
        law: see LAWS. gradients, weights: from `gauss_gradients`. nodes: (e, 8).
        mu, bulk: (e,) moduli over E. positions: (n, 3) current node positions [m].
    """
    kernels = neo_hooke if law == LAWS["neo_hooke"] else corotational
    return float(kernels.energy(gradients, weights, nodes, mu, bulk, positions))


def assemble_elastic(
    law: int, gradients: Any, weights: Any, nodes: Any, mu: Any, bulk: Any, positions: Any, slots: Any, force: Any, data: Any
) -> None:
    """Add the energy's gradient over E to `force` (n, 3) [m^2] and, if `data` is not empty, its tangent [m] to it.

    `slots` (e, 24, 24) says where in `data` an entry of the element's matrix goes; -1 drops it (constrained, or below the
    diagonal of the symmetric matrix). Elements must not be inverted. Other arguments as in `elastic_energy`.
    """
    if law != LAWS["neo_hooke"]:
        corotational.assemble(gradients, weights, nodes, mu, bulk, positions, slots, force, data)
        return
    neo_hooke.add_forces(gradients, weights, nodes, mu, bulk, positions, force)
    if len(data):
        neo_hooke.add_matrices(gradients, weights, nodes, mu, bulk, positions, slots, data)
