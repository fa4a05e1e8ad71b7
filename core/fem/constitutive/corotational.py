"""Kernels of the corotational law, for comparison with engines that have only this one.

W = mu |F - R|^2 at each point, and lambda/2 theta^2, with theta the projection of tr(R^T F) - 3 on
the element's pressures and F = R S the polar decomposition.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.fem.constitutive.hyperelastic import project
from palpate.fem.constitutive.scatter import scatter

__all__ = ["assemble", "energy"]


@njit(cache=True)
def _deformation(gradients: Any, positions: Any, nodes: Any, out: Any) -> None:
    out[:] = 0.0
    for a in range(nodes.shape[0]):
        for i in range(3):
            for j in range(3):
                out[i, j] += positions[nodes[a], i] * gradients[a, j]


@njit(cache=True)
def _cofactor(f: Any, cof: Any) -> float:
    for i in range(3):
        for j in range(3):
            i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            cof[i, j] = f[i1, j1] * f[i2, j2] - f[i1, j2] * f[i2, j1]
    return f[0, 0] * cof[0, 0] + f[0, 1] * cof[0, 1] + f[0, 2] * cof[0, 2]  # type: ignore[no-any-return]


@njit(cache=True)
def _polar(f: Any, rotation: Any) -> None:
    """Compute the rotation nearest to f by Higham's scaled Newton iteration."""
    rotation[:] = f
    cof = np.empty((3, 3))
    for _ in range(30):
        det = _cofactor(rotation, cof)
        scale = abs(det) ** (-1.0 / 3.0)
        change = 0.0
        for i in range(3):
            for j in range(3):
                new = 0.5 * (scale * rotation[i, j] + cof[i, j] / (scale * det))
                change += (new - rotation[i, j]) ** 2
                rotation[i, j] = new
        if change < 1e-26:
            break


@njit(cache=True)
def _dilatation(f: Any, rotation: Any) -> float:
    """Trace of the stretch minus three; NaN if inverted.

    Its projection carries the volumetric energy.
    """
    if _cofactor(f, rotation) <= 0:
        return np.nan
    _polar(f, rotation)
    trace = -3.0
    for i in range(3):
        for j in range(3):
            trace += rotation[i, j] * f[i, j]
    return trace


@njit(cache=True)
def _density(f: Any, rotation: Any) -> float:
    """Energy density of the deviatoric part at a point, over mu."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += (f[i, j] - rotation[i, j]) ** 2
    return total


@njit(cache=True)
def energy(
    gradients: Any, weights: Any, modes: Any, nodes: Any, mu: Any, bulk: Any, positions: Any
) -> float:
    """Elastic energy over E [m^3]; infinite when an element is inverted at a quadrature point."""
    points = weights.shape[1]
    f, work, trace, theta = np.empty((3, 3)), np.empty((3, 3)), np.empty(points), np.empty(points)
    total = 0.0
    for e in range(nodes.shape[0]):
        for q in range(points):
            _deformation(gradients[e, q], positions, nodes[e], f)
            trace[q] = _dilatation(f, work)
            if np.isnan(trace[q]):
                return np.inf
            total += weights[e, q] * mu[e, q] * _density(f, work)
        project(weights[e], modes[e], trace, theta)
        for q in range(points):
            total += 0.5 * weights[e, q] * bulk[e, q] * theta[q] * theta[q]
    return total


@njit(cache=True)
def _stress(
    f: Any, rotation: Any, mu: float, pressure: float, with_tangent: bool, stress: Any, tangent: Any
) -> None:
    """First Piola-Kirchhoff stress of the deviatoric part and, if required, the tangent of both
    parts.

    The tangent is that at a fixed pressure. dR = R [w]x with (tr S - S) w the axial vector of R^T
    dF - dF^T R, exact (not the usual dR = 0).
    """
    for i in range(3):
        for j in range(3):
            stress[i, j] = 2 * mu * (f[i, j] - rotation[i, j])
    if not with_tangent:
        return
    stretch = rotation.T @ f
    inverse = np.linalg.inv((stretch[0, 0] + stretch[1, 1] + stretch[2, 2]) * np.eye(3) - stretch)
    axial, spin = np.empty(3), np.zeros((3, 3))
    for k in range(3):
        for m in range(3):
            # R^T dF for the unit dF at (k, m) has row vector R[k, :] in column m
            axial[:] = 0.0
            axial[(m + 2) % 3] = rotation[k, (m + 1) % 3]
            axial[(m + 1) % 3] = -rotation[k, (m + 2) % 3]
            w = inverse @ axial
            spin[0, 1], spin[0, 2], spin[1, 2] = -w[2], w[1], -w[0]
            spin[1, 0], spin[2, 0], spin[2, 1] = w[2], -w[1], w[0]
            turn = rotation @ spin
            for i in range(3):
                for j in range(3):
                    tangent[i, j, k, m] = (pressure - 2 * mu) * turn[i, j]
            tangent[k, m, k, m] += 2 * mu


@njit(cache=True)
def _press(
    gradients: Any,
    weights: Any,
    modes: Any,
    bulk: Any,
    positions: Any,
    nodes: Any,
    f: Any,
    work: Any,
    press: Any,
) -> None:
    """Compute F, its rotation and the pressure at all points of an element."""
    dilatation, theta = np.empty(weights.shape[0]), np.empty(weights.shape[0])
    for q in range(weights.shape[0]):
        _deformation(gradients[q], positions, nodes, f[q])
        dilatation[q] = _dilatation(f[q], work[q])
    project(weights, modes, dilatation, theta)
    project(weights, modes, bulk * theta, press)


@njit(cache=True)
def assemble(
    gradients: Any,
    weights: Any,
    modes: Any,
    nodes: Any,
    mu: Any,
    bulk: Any,
    positions: Any,
    slots: Any,
    force: Any,
    data: Any,
) -> None:
    """Add the energy's gradient to `force` and, if `data` is not empty, its tangent to it.

    Args as in `assemble_elastic`.
    """
    points, size, with_tangent = weights.shape[1], 3 * nodes.shape[1], data.shape[0] > 0
    f, work, press = np.empty((points, 3, 3)), np.empty((points, 3, 3)), np.empty(points)
    stress, tangent, half = np.empty((3, 3)), np.empty((3, 3, 3, 3)), np.empty((3, 3, size))
    moved, matrix = np.empty((modes.shape[2], size)), np.empty((size, size))
    for e in range(nodes.shape[0]):
        moved[:] = 0.0
        matrix[:] = 0.0
        _press(gradients[e], weights[e], modes[e], bulk[e], positions, nodes[e], f, work, press)
        for q in range(points):
            w = weights[e, q]
            _stress(f[q], work[q], mu[e, q], press[q], with_tangent, stress, tangent)
            for a in range(nodes.shape[1]):
                for i in range(3):
                    turned = np.sum(work[q, i] * gradients[e, q, a])
                    force[nodes[e, a], i] += w * (
                        np.sum(stress[i] * gradients[e, q, a]) + press[q] * turned
                    )
                    for m in range(modes.shape[2]):
                        moved[m, 3 * a + i] += w * modes[e, q, m] * turned
            if with_tangent:
                _add_point(tangent, gradients[e, q], w, half, matrix)
        if with_tangent:
            for m in range(modes.shape[2]):
                for n in range(modes.shape[2]):
                    matrix += np.sum(
                        weights[e] * bulk[e] * modes[e, :, m] * modes[e, :, n]
                    ) * np.outer(moved[m], moved[n])
            scatter(matrix, slots[e], data)


@njit(cache=True, fastmath={"contract", "reassoc", "nsz"})
def _add_point(tangent: Any, gradients: Any, weight: float, half: Any, matrix: Any) -> None:
    """Add one quadrature point's B^T A B to the upper blocks of the element's matrix.

    Rows are long, for vector instructions.
    """
    for b in range(gradients.shape[0]):
        g0, g1, g2 = weight * gradients[b, 0], weight * gradients[b, 1], weight * gradients[b, 2]
        for j in range(3):
            for i in range(3):
                for k in range(3):
                    half[j, i, 3 * b + k] = (
                        tangent[i, j, k, 0] * g0
                        + tangent[i, j, k, 1] * g1
                        + tangent[i, j, k, 2] * g2
                    )
    for a in range(gradients.shape[0]):
        g0, g1, g2 = gradients[a, 0], gradients[a, 1], gradients[a, 2]
        for i in range(3):
            row, h0, h1, h2 = matrix[3 * a + i], half[0, i], half[1, i], half[2, i]
            for c in range(3 * a, matrix.shape[1]):
                row[c] += g0 * h0[c] + g1 * h1[c] + g2 * h2[c]
