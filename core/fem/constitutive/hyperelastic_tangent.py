"""Tangent kernels of the hyperelastic elements (see `palpate.fem.constitutive.hyperelastic`)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.fem.constitutive.hyperelastic import (
    FUSED,
    deform_element,
    gather,
    relative_stiffness,
    squared_norm,
)

__all__ = ["add_matrices"]

_BLOCKS = 6
"""Blocks of an element's symmetric matrix by axes: (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2,
2)."""


@njit(cache=True, fastmath=FUSED)
def _moduli(
    scale: float,
    press: float,
    hardening: float,
    square: float,
    det: float,
    f: Any,
    c: Any,
    tensor: Any,
) -> None:
    """Derivative of the stress by F at one point: dP_ik / dF_jl at [3 i + k, 3 j + l], for j >= i.

    It is scale [1 - 2/(3 J) (F C + C F) + 5 I1/(9 J^2) C C], plus (press / J) (C C - C C crosswise)
    from the cofactor's own change, with press the factor of C = cof(F) in the stress, plus
    hardening D D with D = F - I1/(3 J) C.
    """
    deviation = square / (3.0 * det)
    mixed, crossed = -2.0 / 3.0 * scale / det, press / det
    squared = 5.0 / 9.0 * scale * square / (det * det) + crossed
    for i in range(3):
        for k in range(3):
            turned, closed = f[3 * i + k], c[3 * i + k]
            hard = hardening * (turned - deviation * closed)
            by_closed = mixed * turned + squared * closed - deviation * hard
            by_turned = mixed * closed + hard
            for j in range(i, 3):
                across = crossed * c[3 * j + k]
                for m in range(3):
                    change = (
                        by_closed * c[3 * j + m] + by_turned * f[3 * j + m] - across * c[3 * i + m]
                    )
                    tensor[3 * i + k, 3 * j + m] = change
            tensor[3 * i + k, 3 * i + k] += scale


@njit(cache=True, fastmath=FUSED)
def _bend(tensor: Any, slopes: Any, bent: Any) -> None:
    """Change of each row (i, k) of the stress with each node's motion along j >= i.

    It is written to `bent` (k, ij, w) of a point.
    """
    block = 0
    for i in range(3):
        for j in range(i, 3):
            for k in range(3):
                own, row = tensor[3 * i + k], bent[k, block]
                by_x, by_y, by_z = own[3 * j], own[3 * j + 1], own[3 * j + 2]
                for b in range(slopes.shape[1]):
                    row[b] = by_x * slopes[0, b] + by_y * slopes[1, b] + by_z * slopes[2, b]
            block += 1


@njit(cache=True, fastmath=FUSED)
def _swell(weight: float, modes: Any, c: Any, slopes: Any, moved: Any) -> None:
    """Add one point's part to the change (m, 3, a) of each mode's theta with each node's motion."""
    for i in range(3):
        by_x, by_y, by_z = weight * c[3 * i], weight * c[3 * i + 1], weight * c[3 * i + 2]
        for m in range(modes.shape[0]):
            row, share = moved[m, i], modes[m]
            for b in range(slopes.shape[1]):
                row[b] += share * (by_x * slopes[0, b] + by_y * slopes[1, b] + by_z * slopes[2, b])


@njit(cache=True, fastmath=FUSED)
def _add_volume(
    weights: Any, modes: Any, bulk: Any, theta: Any, moved: Any, pressed: Any, blocks: Any
) -> None:
    """Add the tangent's part from the change of the pressures.

    It is the sum over m, n of D_mn b_m b_n', with b_m (m, 3, a) the change of mode m's theta.
    """
    for m in range(modes.shape[1]):
        pressed[:] = 0.0
        for n in range(modes.shape[1]):
            stiffness = 0.0
            for q in range(modes.shape[0]):
                curvature = 0.5 * bulk[q] * (1.0 + 1.0 / (theta[q] * theta[q]))
                stiffness += weights[q] * curvature * modes[q, m] * modes[q, n]
            for j in range(3):
                for b in range(pressed.shape[1]):
                    pressed[j, b] += stiffness * moved[n, j, b]
        for a in range(blocks.shape[0]):
            block = 0
            for i in range(3):
                share = moved[m, i, a]
                for j in range(i, 3):
                    row = blocks[a, block]
                    for b in range(pressed.shape[1]):
                        row[b] += share * pressed[j, b]
                    block += 1


@njit(cache=True, fastmath=FUSED)
def add_matrices(
    slopes: Any,
    weights: Any,
    modes: Any,
    nodes: Any,
    mu: Any,
    bulk: Any,
    stiffening: float,
    positions: Any,
    slots: Any,
    data: Any,
) -> None:
    """Add the energy's tangent over E [m] to `data`; `slots` (e, 3 a, 3 a) as in
    `assemble_elastic`.

    With G (3 q, w) an element's slopes, its blocks side by side are one matrix product, G' times
    the result of `_bend` on G.
    """
    points, corners, count = weights.shape[1], nodes.shape[1], modes.shape[2]
    wide = slopes.shape[3]
    x, f, c, scalars = (
        np.zeros((3, wide)),
        np.empty((points, 9)),
        np.empty((points, 9)),
        np.empty((4, points)),
    )
    tensor, bent = np.empty((9, 9)), np.empty((points, 3, _BLOCKS, wide))
    moved, pressed, matrix = (
        np.empty((count, 3, wide)),
        np.empty((3, wide)),
        np.empty((wide, _BLOCKS * wide)),
    )
    blocks = matrix.reshape(wide, _BLOCKS, wide)
    for e in range(nodes.shape[0]):
        gather(positions, nodes[e], x)
        deform_element(slopes[e], weights[e], modes[e], bulk[e], x, f, c, scalars)
        moved[:] = 0.0
        for q in range(points):
            weight, det, square = weights[e, q], scalars[0, q], squared_norm(f[q])
            root = np.cbrt(det * det)
            harder = relative_stiffness(square, root, stiffening)
            scale = weight * mu[e, q] / root * harder
            hardening = 2.0 * scale * stiffening * harder / root
            press = weight * scalars[3, q] - scale * square / (3.0 * det)
            _moduli(scale, press, hardening, square, det, f[q], c[q], tensor)
            _bend(tensor, slopes[e, q], bent[q])
            _swell(weight, modes[e, q], c[q], slopes[e, q], moved)
        np.dot(
            slopes[e].reshape(3 * points, wide).T, bent.reshape(3 * points, _BLOCKS * wide), matrix
        )
        _add_volume(weights[e], modes[e], bulk[e], scalars[1], moved, pressed, blocks[:corners])
        _scatter_blocks(blocks, slots[e], data)


@njit(cache=True)
def _scatter_blocks(blocks: Any, slots: Any, data: Any) -> None:
    """Add the blocks (a, ij, b), j >= i, of a symmetric element matrix to `data`."""
    corners = slots.shape[0] // 3
    for a in range(corners):
        block = 0
        for i in range(3):
            for j in range(i, 3):
                for b in range(corners):
                    slot = slots[3 * a + i, 3 * b + j]
                    if slot >= 0:
                        data[slot] += blocks[a, block, b]
                    if i != j:
                        slot = slots[3 * b + j, 3 * a + i]
                        if slot >= 0:
                            data[slot] += blocks[a, block, b]
                block += 1
