"""Kernels of hyperelastic elements of any shape, written out in scalars: they are most of a
replay's time.

W = -mu/(2 k) ln(1 - k x) with x = J^(-2/3) tr F^T F - 3 at each point (Gent 1996, k = 1 / J_m;
neo-Hooke, mu/2 x, for k = 0), and kappa/4 (theta^2 - 1 - 2 ln theta), theta the projection of J =
det F on the element's pressures N_m, orthonormal over its volume at rest: theta = sum_m N_m
(integral of N_m J).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = ["add_forces", "add_matrices", "energy", "project", "scatter"]

_FUSED = {"contract", "reassoc", "nsz"}
_BLOCKS = 6
"""Of an element's symmetric matrix, sorted by axes: (0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2,
2)."""


@njit(cache=True, fastmath=_FUSED, inline="always")
def _gather(positions: Any, nodes: Any, x: Any) -> None:
    """Positions of an element's nodes, one row for each axis: x (3, w)."""
    for a in range(nodes.shape[0]):
        for i in range(3):
            x[i, a] = positions[nodes[a], i]


@njit(cache=True, fastmath=_FUSED, inline="always")
def _deform(slopes: Any, x: Any, f: Any, c: Any) -> float:
    """F and its cofactors, row by row (9,), of one point; returns det F."""
    f00 = f01 = f02 = f10 = f11 = f12 = f20 = f21 = f22 = 0.0
    g0, g1, g2, x0, x1, x2 = slopes[0], slopes[1], slopes[2], x[0], x[1], x[2]
    for a in range(slopes.shape[1]):
        f00, f01, f02 = f00 + x0[a] * g0[a], f01 + x0[a] * g1[a], f02 + x0[a] * g2[a]
        f10, f11, f12 = f10 + x1[a] * g0[a], f11 + x1[a] * g1[a], f12 + x1[a] * g2[a]
        f20, f21, f22 = f20 + x2[a] * g0[a], f21 + x2[a] * g1[a], f22 + x2[a] * g2[a]
    f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8] = (
        f00,
        f01,
        f02,
        f10,
        f11,
        f12,
        f20,
        f21,
        f22,
    )
    c00, c01, c02 = f11 * f22 - f12 * f21, f12 * f20 - f10 * f22, f10 * f21 - f11 * f20
    c[0], c[1], c[2] = c00, c01, c02
    c[3], c[4], c[5] = f02 * f21 - f01 * f22, f00 * f22 - f02 * f20, f01 * f20 - f00 * f21
    c[6], c[7], c[8] = f01 * f12 - f02 * f11, f02 * f10 - f00 * f12, f00 * f11 - f01 * f10
    return f00 * c00 + f01 * c01 + f02 * c02


@njit(cache=True, fastmath=_FUSED, inline="always")
def _square(f: Any) -> float:
    total = 0.0
    for k in range(9):
        total += f[k] * f[k]
    return total


@njit(cache=True, fastmath=_FUSED, inline="always")
def project(weights: Any, modes: Any, values: Any, projected: Any) -> None:
    """The part of `values` (q,) that the element's pressures (q, m) can follow."""
    projected[:] = 0.0
    for m in range(modes.shape[1]):
        share = 0.0
        for q in range(modes.shape[0]):
            share += weights[q] * modes[q, m] * values[q]
        for q in range(modes.shape[0]):
            projected[q] += share * modes[q, m]


@njit(cache=True, fastmath=_FUSED)
def energy(
    slopes: Any,
    weights: Any,
    modes: Any,
    nodes: Any,
    mu: Any,
    bulk: Any,
    stiffening: float,
    positions: Any,
) -> float:
    """Elastic energy over E [m^3]; infinite when an element is inverted or stretched to its limit
    at a quadrature point.
    """
    points = weights.shape[1]
    x, f, c = np.zeros((3, slopes.shape[3])), np.empty(9), np.empty(9)
    det, theta = np.empty(points), np.empty(points)
    total = 0.0
    for e in range(nodes.shape[0]):
        _gather(positions, nodes[e], x)
        for q in range(points):
            det[q] = _deform(slopes[e, q], x, f, c)
            if not det[q] > 0.0:
                return np.inf
            strain = _square(f) / np.cbrt(det[q] * det[q]) - 3.0
            if stiffening > 0.0:
                left = 1.0 - stiffening * strain
                if not left > 0.0:
                    return np.inf
                strain = -np.log(left) / stiffening
            total += 0.5 * mu[e, q] * weights[e, q] * strain
        project(weights[e], modes[e], det, theta)
        for q in range(points):
            if not theta[q] > 0.0:
                return np.inf
            total += (
                0.25
                * bulk[e, q]
                * weights[e, q]
                * (theta[q] * theta[q] - 1.0 - 2.0 * np.log(theta[q]))
            )
    return total


@njit(cache=True, fastmath=_FUSED, inline="always")
def _press(
    slopes: Any, weights: Any, modes: Any, bulk: Any, x: Any, f: Any, c: Any, scalars: Any
) -> None:
    """F and cofactors at all points of an element; rows of `scalars` get det F, theta, U'(theta),
    pressure.
    """
    det, theta, slope = scalars[0], scalars[1], scalars[2]
    for q in range(weights.shape[0]):
        det[q] = _deform(slopes[q], x, f[q], c[q])
    project(weights, modes, det, theta)
    for q in range(weights.shape[0]):
        slope[q] = 0.5 * bulk[q] * (theta[q] - 1.0 / theta[q])
    project(weights, modes, slope, scalars[3])


@njit(cache=True, fastmath=_FUSED, inline="always")
def _hardening(square: float, root: float, stiffening: float) -> float:
    """How much stiffer than at rest the material is, 1 / (1 - k x); `root` is J^(2/3)."""
    return 1.0 / (1.0 - stiffening * (square / root - 3.0))


@njit(cache=True, fastmath=_FUSED)
def add_forces(
    slopes: Any,
    weights: Any,
    modes: Any,
    nodes: Any,
    mu: Any,
    bulk: Any,
    stiffening: float,
    positions: Any,
    force: Any,
) -> None:
    """Add the energy's gradient over E to `force` (n, 3) [m^2]. Elements must not be inverted."""
    points, corners, wide = weights.shape[1], nodes.shape[1], slopes.shape[3]
    x, f, c, p = np.zeros((3, wide)), np.empty((points, 9)), np.empty((points, 9)), np.empty(9)
    scalars, own = np.empty((4, points)), np.empty((3, wide))
    det, press = scalars[0], scalars[3]
    for e in range(nodes.shape[0]):
        _gather(positions, nodes[e], x)
        _press(slopes[e], weights[e], modes[e], bulk[e], x, f, c, scalars)
        own[:] = 0.0
        for q in range(points):
            root, square = np.cbrt(det[q] * det[q]), _square(f[q])
            scale = weights[e, q] * mu[e, q] / root * _hardening(square, root, stiffening)
            by_volume = weights[e, q] * press[q] - scale * square / (3.0 * det[q])
            for k in range(9):
                p[k] = scale * f[q, k] + by_volume * c[q, k]
            _push(p, slopes[e, q], own)
        for a in range(corners):
            for i in range(3):
                force[nodes[e, a], i] += own[i, a]


@njit(cache=True, fastmath=_FUSED, inline="always")
def _push(p: Any, slopes: Any, own: Any) -> None:
    """Add a point's stress times volume, row by row (9,), to the forces on its element's nodes, one
    row for each axis (3, w).
    """
    p0, p1, p2, p3, p4, p5, p6, p7, p8 = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8]
    g0, g1, g2, x, y, z = slopes[0], slopes[1], slopes[2], own[0], own[1], own[2]
    for a in range(slopes.shape[1]):
        x[a] += p0 * g0[a] + p1 * g1[a] + p2 * g2[a]
        y[a] += p3 * g0[a] + p4 * g1[a] + p5 * g2[a]
        z[a] += p6 * g0[a] + p7 * g1[a] + p8 * g2[a]


@njit(cache=True, fastmath=_FUSED)
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
    """How the stress changes with F at one point: dP_ik / dF_jl at [3 i + k, 3 j + l], for j >= i.

    It is scale [1 - 2/(3 J) (F C + C F) + 5 I1/(9 J^2) C C] plus what the cofactor's own change
    brings, (press / J) (C C - C C crosswise), press the factor of C = cof(F) in the stress, plus
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


@njit(cache=True, fastmath=_FUSED)
def _bend(tensor: Any, slopes: Any, bent: Any) -> None:
    """The change of each row (i, k) of the stress that each node's motion along j >= i brings:
    `bent` (k, ij, w) of a point.
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


@njit(cache=True, fastmath=_FUSED)
def _swell(weight: float, modes: Any, c: Any, slopes: Any, moved: Any) -> None:
    """Add one point's part to the change (m, 3, a) of each mode's theta with each node's motion."""
    for i in range(3):
        by_x, by_y, by_z = weight * c[3 * i], weight * c[3 * i + 1], weight * c[3 * i + 2]
        for m in range(modes.shape[0]):
            row, share = moved[m, i], modes[m]
            for b in range(slopes.shape[1]):
                row[b] += share * (by_x * slopes[0, b] + by_y * slopes[1, b] + by_z * slopes[2, b])


@njit(cache=True, fastmath=_FUSED)
def _add_volume(
    weights: Any, modes: Any, bulk: Any, theta: Any, moved: Any, pressed: Any, blocks: Any
) -> None:
    """Add what the pressures' own change brings: sum over m, n of D_mn b_m b_n', b_m (m, 3, a) the
    change of mode m's theta.
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


@njit(cache=True, fastmath=_FUSED)
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

    With G (3 q, w) an element's slopes, its blocks side by side are one product of matrices, G'
    times what `_bend` makes of G.
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
        _gather(positions, nodes[e], x)
        _press(slopes[e], weights[e], modes[e], bulk[e], x, f, c, scalars)
        moved[:] = 0.0
        for q in range(points):
            weight, det, square = weights[e, q], scalars[0, q], _square(f[q])
            root = np.cbrt(det * det)
            harder = _hardening(square, root, stiffening)
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
    """Write the blocks (a, ij, b), j >= i, of a symmetric element matrix where their entries
    belong.
    """
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


@njit(cache=True)
def scatter(matrix: Any, slots: Any, data: Any) -> None:
    """Write the element's matrix, of which the upper blocks are given, where its entries belong."""
    for row in range(matrix.shape[0]):
        for column in range(3 * (row // 3), matrix.shape[0]):
            slot = slots[row, column]
            if slot >= 0:
                data[slot] += matrix[row, column]
            if column // 3 != row // 3:
                slot = slots[column, row]
                if slot >= 0:
                    data[slot] += matrix[row, column]
