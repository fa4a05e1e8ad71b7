"""Kernels of the neo-Hookean hexahedra with mean dilatation, written out in scalars: they are most of a replay's time.

W = mu/2 (J^(-2/3) tr F^T F - 3) at each point, kappa/4 (theta^2 - 1 - 2 ln theta) per element, theta = mean of J = det F.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = ["add_forces", "add_matrices", "energy"]

_FUSED = {"contract", "reassoc", "nsz"}


@njit(cache=True, fastmath=_FUSED, inline="always")
def _gather(positions: Any, nodes: Any, x: Any) -> None:
    for a in range(8):
        for i in range(3):
            x[a, i] = positions[nodes[a], i]


@njit(cache=True, fastmath=_FUSED, inline="always")
def _deform(g: Any, x: Any, f: Any, c: Any) -> float:
    """F and its cofactors, row by row (9,), of one point; returns det F."""
    f00 = f01 = f02 = f10 = f11 = f12 = f20 = f21 = f22 = 0.0
    for a in range(8):
        g0, g1, g2, x0, x1, x2 = g[a, 0], g[a, 1], g[a, 2], x[a, 0], x[a, 1], x[a, 2]
        f00, f01, f02 = f00 + x0 * g0, f01 + x0 * g1, f02 + x0 * g2
        f10, f11, f12 = f10 + x1 * g0, f11 + x1 * g1, f12 + x1 * g2
        f20, f21, f22 = f20 + x2 * g0, f21 + x2 * g1, f22 + x2 * g2
    f[0], f[1], f[2], f[3], f[4], f[5], f[6], f[7], f[8] = f00, f01, f02, f10, f11, f12, f20, f21, f22
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


@njit(cache=True, fastmath=_FUSED)
def energy(gradients: Any, weights: Any, nodes: Any, mu: Any, bulk: Any, positions: Any) -> float:
    """Elastic energy over E [m^3]; infinite when an element is inverted at a quadrature point."""
    x, f, c = np.empty((8, 3)), np.empty(9), np.empty(9)
    total = 0.0
    for e in range(nodes.shape[0]):
        _gather(positions, nodes[e], x)
        volume, mean, shape = 0.0, 0.0, 0.0
        for q in range(8):
            det = _deform(gradients[e, q], x, f, c)
            if not det > 0.0:
                return np.inf
            volume += weights[e, q]
            mean += weights[e, q] * det
            shape += weights[e, q] * (_square(f) / np.cbrt(det * det) - 3.0)
        theta = mean / volume
        total += 0.5 * mu[e] * shape + 0.25 * volume * bulk[e] * (theta * theta - 1.0 - 2.0 * np.log(theta))
    return total


@njit(cache=True, fastmath=_FUSED, inline="always")
def _pressure(gradients: Any, weights: Any, bulk: float, x: Any, f: Any, c: Any, det: Any) -> tuple[float, float]:
    """F, cofactors and determinants at all points of an element; its pressure and, over the volume, how that grows with theta."""
    volume, mean = 0.0, 0.0
    for q in range(8):
        det[q] = _deform(gradients[q], x, f[q], c[q])
        volume += weights[q]
        mean += weights[q] * det[q]
    theta = mean / volume
    return 0.5 * bulk * (theta - 1.0 / theta), 0.5 * bulk * (1.0 + 1.0 / (theta * theta)) / volume


@njit(cache=True, fastmath=_FUSED)
def add_forces(gradients: Any, weights: Any, nodes: Any, mu: Any, bulk: Any, positions: Any, force: Any) -> None:
    """Add the energy's gradient over E to `force` (n, 3) [m^2]. Elements must not be inverted."""
    x, f, c, det = np.empty((8, 3)), np.empty((8, 9)), np.empty((8, 9)), np.empty(8)
    p, own = np.empty(9), np.empty((8, 3))
    for e in range(nodes.shape[0]):
        _gather(positions, nodes[e], x)
        pressure, _ = _pressure(gradients[e], weights[e], bulk[e], x, f, c, det)
        own[:] = 0.0
        for q in range(8):
            scale = weights[e, q] * mu[e] / np.cbrt(det[q] * det[q])
            press = weights[e, q] * pressure - scale * _square(f[q]) / (3.0 * det[q])
            for k in range(9):
                p[k] = scale * f[q, k] + press * c[q, k]
            for a in range(8):
                g0, g1, g2 = gradients[e, q, a, 0], gradients[e, q, a, 1], gradients[e, q, a, 2]
                own[a, 0] += p[0] * g0 + p[1] * g1 + p[2] * g2
                own[a, 1] += p[3] * g0 + p[4] * g1 + p[5] * g2
                own[a, 2] += p[6] * g0 + p[7] * g1 + p[8] * g2
        for a in range(8):
            for i in range(3):
                force[nodes[e, a], i] += own[a, i]


@njit(cache=True, fastmath=_FUSED, inline="always")
def _images(g: Any, f: Any, c: Any, turned: Any, closed: Any, spread: Any) -> None:
    """F g and cof(F) g of each node's gradient g, as rows (24,); and each component of the latter, thrice per node (3, 24)."""
    for a in range(8):
        g0, g1, g2 = g[a, 0], g[a, 1], g[a, 2]
        for i in range(3):
            turned[3 * a + i] = f[3 * i] * g0 + f[3 * i + 1] * g1 + f[3 * i + 2] * g2
            value = c[3 * i] * g0 + c[3 * i + 1] * g1 + c[3 * i + 2] * g2
            closed[3 * a + i] = value
            for k in range(3):
                spread[i, 3 * a + k] = value


@njit(cache=True, fastmath=_FUSED, inline="always")
def _add_point(g: Any, scale: float, press: float, square: float, det: float, images: Any, matrix: Any) -> None:
    """Add one point's part to the upper blocks of the element's matrix; rows are long, for vector instructions.

    With f = F g, c = cof(F) g of each node: scale [(g.g') 1 - 2/(3 J) (f c' + c f') + 5 I1/(9 J^2) c c'] plus what the
    cofactor's own change brings, (press / J) (c c' - c' c) crosswise, press the factor of cof(F) in the stress.
    """
    turned, closed, spread, tiled = images
    mixed = -2.0 / 3.0 * scale / det
    crossed = press / det
    square_part = 5.0 / 9.0 * scale * square / (det * det)
    for a in range(8):
        g0, g1, g2 = scale * g[a, 0], scale * g[a, 1], scale * g[a, 2]
        for b in range(a, 8):
            straight = g0 * g[b, 0] + g1 * g[b, 1] + g2 * g[b, 2]
            for i in range(3):
                matrix[3 * a + i, 3 * b + i] += straight
        for k in range(3):
            for b in range(8):
                tiled[3 * b + k] = crossed * closed[3 * a + k]
        for i in range(3):
            row, other = matrix[3 * a + i], spread[i]
            by_closed = mixed * turned[3 * a + i] + (square_part + crossed) * closed[3 * a + i]
            by_turned = mixed * closed[3 * a + i]
            for m in range(3 * a, 24):
                row[m] += by_closed * closed[m] + by_turned * turned[m] - tiled[m] * other[m]


@njit(cache=True, fastmath=_FUSED)
def add_matrices(gradients: Any, weights: Any, nodes: Any, mu: Any, bulk: Any, positions: Any, slots: Any, data: Any) -> None:
    """Add the energy's tangent over E [m] to `data`; `slots` (e, 24, 24) as in `assemble_elastic`."""
    x, f, c, det = np.empty((8, 3)), np.empty((8, 9)), np.empty((8, 9)), np.empty(8)
    images = (np.empty(24), np.empty(24), np.empty((3, 24)), np.empty(24))
    mean, matrix = np.empty(24), np.empty((24, 24))
    for e in range(nodes.shape[0]):
        _gather(positions, nodes[e], x)
        pressure, slope = _pressure(gradients[e], weights[e], bulk[e], x, f, c, det)
        matrix[:] = 0.0
        mean[:] = 0.0
        for q in range(8):
            w, square = weights[e, q], _square(f[q])
            scale = w * mu[e] / np.cbrt(det[q] * det[q])
            _images(gradients[e, q], f[q], c[q], images[0], images[1], images[2])
            _add_point(gradients[e, q], scale, w * pressure - scale * square / (3.0 * det[q]), square, det[q], images, matrix)
            for m in range(24):
                mean[m] += w * images[1][m]
        _scatter(matrix, mean, slope, slots[e], data)


@njit(cache=True)
def _scatter(matrix: Any, mean: Any, slope: float, slots: Any, data: Any) -> None:
    """Add the volumetric rank-one part and write the element's matrix where its entries belong."""
    for a in range(8):
        for b in range(a, 8):
            for i in range(3):
                for k in range(3):
                    row, column = 3 * a + i, 3 * b + k
                    value = matrix[row, column] + slope * mean[row] * mean[column]
                    slot = slots[row, column]
                    if slot >= 0:
                        data[slot] += value
                    if a != b:
                        slot = slots[column, row]
                        if slot >= 0:
                            data[slot] += value
