"""Kernels of hyperelastic elements of any shape, written in scalars: they take most of a replay's
time.

W = -mu/(2 k) ln(1 - k x) with x = J^(-2/3) tr F^T F - 3 at each point (Gent 1996, k = 1 / J_m;
neo-Hooke, mu/2 x, for k = 0), and kappa/4 (theta^2 - 1 - 2 ln theta), with theta the projection of
J = det F on the element's pressures N_m, orthonormal over its volume at rest: theta = sum_m N_m
(integral of N_m J).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = [
    "FUSED",
    "add_forces",
    "deform_element",
    "energy",
    "gather",
    "project",
    "relative_stiffness",
    "squared_norm",
]

FUSED = {"contract", "reassoc", "nsz"}


@njit(cache=True, fastmath=FUSED, inline="always")
def gather(positions: Any, nodes: Any, x: Any) -> None:
    """Copy the positions of an element's nodes into x (3, w), one row for each axis."""
    for a in range(nodes.shape[0]):
        for i in range(3):
            x[i, a] = positions[nodes[a], i]


@njit(cache=True, fastmath=FUSED, inline="always")
def _deform(slopes: Any, x: Any, f: Any, c: Any) -> float:
    """Compute F and its cofactors of one point, row by row (9,); returns det F."""
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


@njit(cache=True, fastmath=FUSED, inline="always")
def squared_norm(f: Any) -> float:
    total = 0.0
    for k in range(9):
        total += f[k] * f[k]
    return total


@njit(cache=True, fastmath=FUSED, inline="always")
def project(weights: Any, modes: Any, values: Any, projected: Any) -> None:
    """Project `values` (q,) on the element's pressures (q, m)."""
    projected[:] = 0.0
    for m in range(modes.shape[1]):
        share = 0.0
        for q in range(modes.shape[0]):
            share += weights[q] * modes[q, m] * values[q]
        for q in range(modes.shape[0]):
            projected[q] += share * modes[q, m]


@njit(cache=True, fastmath=FUSED)
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
    """Elastic energy over E [m^3].

    It is infinite if an element is inverted or stretched to its limit at a quadrature point.
    """
    points = weights.shape[1]
    x, f, c = np.zeros((3, slopes.shape[3])), np.empty(9), np.empty(9)
    det, theta = np.empty(points), np.empty(points)
    total = 0.0
    for e in range(nodes.shape[0]):
        gather(positions, nodes[e], x)
        for q in range(points):
            det[q] = _deform(slopes[e, q], x, f, c)
            if not det[q] > 0.0:
                return np.inf
            strain = squared_norm(f) / np.cbrt(det[q] * det[q]) - 3.0
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


@njit(cache=True, fastmath=FUSED, inline="always")
def deform_element(
    slopes: Any, weights: Any, modes: Any, bulk: Any, x: Any, f: Any, c: Any, scalars: Any
) -> None:
    """Compute F and cofactors at all points of an element.

    Rows of `scalars` receive det F, theta, U'(theta) and the pressure.
    """
    det, theta, slope = scalars[0], scalars[1], scalars[2]
    for q in range(weights.shape[0]):
        det[q] = _deform(slopes[q], x, f[q], c[q])
    project(weights, modes, det, theta)
    for q in range(weights.shape[0]):
        slope[q] = 0.5 * bulk[q] * (theta[q] - 1.0 / theta[q])
    project(weights, modes, slope, scalars[3])


@njit(cache=True, fastmath=FUSED, inline="always")
def relative_stiffness(square: float, root: float, stiffening: float) -> float:
    """Stiffness over that at rest, 1 / (1 - k x) [1]; `root` is J^(2/3)."""
    return 1.0 / (1.0 - stiffening * (square / root - 3.0))


@njit(cache=True, fastmath=FUSED)
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
        gather(positions, nodes[e], x)
        deform_element(slopes[e], weights[e], modes[e], bulk[e], x, f, c, scalars)
        own[:] = 0.0
        for q in range(points):
            root, square = np.cbrt(det[q] * det[q]), squared_norm(f[q])
            scale = weights[e, q] * mu[e, q] / root * relative_stiffness(square, root, stiffening)
            by_volume = weights[e, q] * press[q] - scale * square / (3.0 * det[q])
            for k in range(9):
                p[k] = scale * f[q, k] + by_volume * c[q, k]
            _push(p, slopes[e, q], own)
        for a in range(corners):
            for i in range(3):
                force[nodes[e, a], i] += own[i, a]


@njit(cache=True, fastmath=FUSED, inline="always")
def _push(p: Any, slopes: Any, own: Any) -> None:
    """Add a point's stress times volume (9,), row by row, to the forces on its element's nodes.

    The forces `own` (3, w) have one row for each axis.
    """
    p0, p1, p2, p3, p4, p5, p6, p7, p8 = p[0], p[1], p[2], p[3], p[4], p[5], p[6], p[7], p[8]
    g0, g1, g2, x, y, z = slopes[0], slopes[1], slopes[2], own[0], own[1], own[2]
    for a in range(slopes.shape[1]):
        x[a] += p0 * g0[a] + p1 * g1[a] + p2 * g2[a]
        y[a] += p3 * g0[a] + p4 * g1[a] + p5 * g2[a]
        z[a] += p6 * g0[a] + p7 * g1[a] + p8 * g2[a]
