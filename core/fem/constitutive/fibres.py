"""Kernels of fibres along one direction, added to any law: the standard reinforcing model (Qiu and
Pence 1997).

W = g/2 (I4 - 1)^2 with I4 = |F a|^2, a the direction at rest. I4 is of the whole stretch, not of
its isochoric part: that would let a nearly incompressible body change its volume instead of its
fibres' length (Helfenstein et al. 2010).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.fem.constitutive.scatter import scatter

__all__ = ["add_forces", "add_matrices", "energy"]


@njit(cache=True)
def _stretch(
    gradients: Any, positions: Any, nodes: Any, direction: Any, turned: Any, along: Any
) -> float:
    """I4 of one point.

    `turned` (3,) receives F a, `along` (a,) each node's gradient along the fibres [1/m].
    """
    turned[:] = 0.0
    for a in range(nodes.shape[0]):
        along[a] = (
            gradients[a, 0] * direction[0]
            + gradients[a, 1] * direction[1]
            + gradients[a, 2] * direction[2]
        )
        for i in range(3):
            turned[i] += positions[nodes[a], i] * along[a]
    return turned[0] ** 2 + turned[1] ** 2 + turned[2] ** 2  # type: ignore[no-any-return]


@njit(cache=True)
def energy(
    gradients: Any, weights: Any, nodes: Any, stiffness: Any, direction: Any, positions: Any
) -> float:
    """Energy of the fibres over E [m^3]; `stiffness` (e, q) is g over E."""
    turned, along, total = np.empty(3), np.empty(nodes.shape[1]), 0.0
    for e in range(nodes.shape[0]):
        for q in range(weights.shape[1]):
            square = _stretch(gradients[e, q], positions, nodes[e], direction, turned, along)
            total += 0.5 * weights[e, q] * stiffness[e, q] * (square - 1.0) ** 2
    return total


@njit(cache=True)
def add_forces(
    gradients: Any,
    weights: Any,
    nodes: Any,
    stiffness: Any,
    direction: Any,
    positions: Any,
    force: Any,
) -> None:
    """Add the energy's gradient over E to `force` (n, 3) [m^2]."""
    turned, along = np.empty(3), np.empty(nodes.shape[1])
    for e in range(nodes.shape[0]):
        for q in range(weights.shape[1]):
            square = _stretch(gradients[e, q], positions, nodes[e], direction, turned, along)
            pull = 2.0 * weights[e, q] * stiffness[e, q] * (square - 1.0)
            for a in range(nodes.shape[1]):
                for i in range(3):
                    force[nodes[e, a], i] += pull * along[a] * turned[i]


@njit(cache=True)
def add_matrices(
    gradients: Any,
    weights: Any,
    nodes: Any,
    stiffness: Any,
    direction: Any,
    positions: Any,
    slots: Any,
    data: Any,
) -> None:
    """Add the energy's tangent over E [m] to `data`; `slots` (e, 3 a, 3 a) as in
    `assemble_elastic`.
    """
    size = 3 * nodes.shape[1]
    turned, along, matrix = np.empty(3), np.empty(nodes.shape[1]), np.empty((size, size))
    for e in range(nodes.shape[0]):
        matrix[:] = 0.0
        for q in range(weights.shape[1]):
            square = _stretch(gradients[e, q], positions, nodes[e], direction, turned, along)
            scale = weights[e, q] * stiffness[e, q]
            for row in range(size):
                for column in range(3 * (row // 3), size):
                    share = 4.0 * turned[row % 3] * turned[column % 3]
                    if row % 3 == column % 3:
                        share += 2.0 * (square - 1.0)
                    matrix[row, column] += scale * share * along[row // 3] * along[column // 3]
        scatter(matrix, slots[e], data)
