"""Ciarlet's compressible Mooney-Rivlin law on ten-node tetrahedra with a mean dilatation.

W(F) = c10 (I1 - 3) + c01 (I2 - 3) - (2 c10 + 4 c01) ln J

plus per element V U(Jm), U(J) = l/4 (J^2 - 1 - 2 ln J), with Jm the element's mean of J, which
keeps nearly incompressible tetrahedra from locking. At small strain the shear modulus is
2 (c10 + c01) and Lame's first constant l + 4 c01. A replay that assumes another law with the same E
and nu differs from this one at large strain only, as it would from a real gel. The loops are
compiled by numba.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray

__all__ = [
    "SECOND_INVARIANT_SHARE",
    "assemble_solid",
    "constants",
    "deformation_gradient",
    "solid_energy",
    "spread",
    "turn_gradients",
]

SECOND_INVARIANT_SHARE = 0.1
"""Share of the shear modulus that belongs to the second invariant [1]."""
_FAST = {"contract", "reassoc", "arcp", "nsz"}


def constants(
    young_modulus: FloatArray, poisson_ratio: FloatArray | float, relaxed: float = 0.0
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """c10, c01 and l [Pa] for E [Pa] and nu [1] at small strain, with a share `relaxed` [1] of the
    shear modulus removed.
    """
    shear = young_modulus / (2 * (1 + poisson_ratio))
    lame = young_modulus * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio))
    bulk = lame + 2 / 3 * shear
    shear = (1 - relaxed) * shear
    c01 = 0.5 * shear * SECOND_INVARIANT_SHARE
    return 0.5 * shear - c01, c01, bulk - 2 / 3 * shear - 4 * c01


@njit(cache=True, fastmath=_FAST)
def deformation_gradient(u: Any, nodes: Any, g: Any, f: Any) -> float:
    """Fill the deformation gradient f (3, 3) and return its determinant."""
    for i in range(3):
        for j in range(3):
            f[i, j] = 1.0 if i == j else 0.0
    for a in range(10):
        for i in range(3):
            v = u[nodes[a], i]
            for j in range(3):
                f[i, j] += v * g[a, j]
    return float(
        f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
        - f[0, 1] * (f[1, 0] * f[2, 2] - f[1, 2] * f[2, 0])
        + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0])
    )


@njit(cache=True, fastmath=_FAST)
def turn_gradients(f: Any, along: Any, g: Any, fa: Any, ha: Any) -> None:
    """Write F `along` to fa and F^-T g to ha, with F = f (3, 3).

    All others are (10, 3); g holds the shape gradients [1/m].
    """
    inverse = np.linalg.inv(f)
    for a in range(10):
        for i in range(3):
            fa[a, i] = f[i, 0] * along[a, 0] + f[i, 1] * along[a, 1] + f[i, 2] * along[a, 2]
            ha[a, i] = inverse[0, i] * g[a, 0] + inverse[1, i] * g[a, 1] + inverse[2, i] * g[a, 2]


@njit(cache=True, fastmath=_FAST)
def spread(
    shares: Any, nodes: Any, pull: Any, t: Any, stiffness: Any, force: Any, coupling: Any
) -> None:
    """Distribute the force on a surface point to its nodes (10,) by their shape values (10,).

    The force is `pull` (3,) [N], its derivative t (3, 3) [N/m]. Only upper node pairs of the
    element stiffness (10, 10, 3, 3) are filled; force (n, 3) and coupling (n, 3, 3) are those of
    all nodes.
    """
    for a in range(10):
        share = shares[a]
        if share == 0.0:
            continue
        for i in range(3):
            force[nodes[a], i] += pull[i] * share
            for k in range(3):
                coupling[nodes[a], i, k] += share * t[i, k]
        for b in range(a, 10):
            for i in range(3):
                for k in range(3):
                    stiffness[a, b, i, k] += share * shares[b] * t[i, k]


@njit(cache=True, fastmath=_FAST)
def solid_energy(
    u: Any, elements: Any, gradients: Any, weights: Any, c10: Any, c01: Any, lame: Any
) -> float:
    """Stored energy [J] of displacements u (n, 3) [m]; infinite where an element is inverted."""
    f = np.empty((3, 3))
    total = 0.0
    for e in range(elements.shape[0]):
        volume = 0.0
        mean = 0.0
        for q in range(weights.shape[1]):
            det = deformation_gradient(u, elements[e], gradients[e, q], f)
            if det <= 1e-3:
                return np.inf
            w = weights[e, q]
            volume += w
            mean += w * det
            c = f.T @ f
            i1 = c[0, 0] + c[1, 1] + c[2, 2]
            i2 = 0.5 * (i1 * i1 - (c * c).sum())
            d = 2 * c10[e, q] + 4 * c01[e, q]
            total += w * (c10[e, q] * (i1 - 3) + c01[e, q] * (i2 - 3) - d * np.log(det))
        mean /= volume
        total += volume * lame[e] / 4 * (mean * mean - 1 - 2 * np.log(mean))
    return total


@njit(cache=True, fastmath=_FAST)
def _add_stiffness(
    stiffness: Any,
    gradients: Any,
    fa: Any,
    ha: Any,
    b: Any,
    first: float,
    second: float,
    pressed: float,
    turned: float,
) -> None:
    """Add one volume point to the element stiffness (10, 10, 3, 3) [N/m]; the four last arguments
    are the factors of its kinds of terms [Pa m^3].
    """
    for m in range(10):
        for n in range(m, 10):
            alpha = 0.0
            beta = 0.0
            for i in range(3):
                alpha += gradients[m, i] * gradients[n, i]
                beta += fa[m, i] * fa[n, i]
            for i in range(3):
                for k in range(3):
                    stiffness[m, n, i, k] += (
                        second * (2 * fa[m, i] * fa[n, k] - fa[n, i] * fa[m, k] - alpha * b[i, k])
                        + pressed * ha[m, i] * ha[n, k]
                        + turned * ha[n, i] * ha[m, k]
                    )
                stiffness[m, n, i, i] += first * alpha - second * beta


@njit(cache=True, fastmath=_FAST)
def assemble_solid(
    u: Any,
    elements: Any,
    gradients: Any,
    weights: Any,
    c10: Any,
    c01: Any,
    lame: Any,
    stiffness: Any,
    force: Any,
) -> None:
    """Add to element stiffness (e, 10, 10, 3, 3) [N/m], upper node pairs only, and to force (n, 3)
    [N].
    """
    points = weights.shape[1]
    fs = np.empty((points, 3, 3))
    dets = np.empty(points)
    fa, ha, mean_gradient = np.empty((10, 3)), np.empty((10, 3)), np.empty((10, 3))
    for e in range(elements.shape[0]):
        volume = mean = 0.0
        for q in range(points):
            dets[q] = deformation_gradient(u, elements[e], gradients[e, q], fs[q])
            volume += weights[e, q]
            mean += weights[e, q] * dets[q]
        mean /= volume
        pressure = 0.5 * lame[e] * (mean - 1 / mean)
        mean_gradient[:] = 0.0
        for q in range(points):
            f, det, w = fs[q], dets[q], weights[e, q]
            a10 = 2 * c10[e, q]
            a01 = 2 * c01[e, q]
            d = a10 + 2 * a01
            turn_gradients(f, gradients[e, q], gradients[e, q], fa, ha)
            b = f @ f.T
            i1 = b[0, 0] + b[1, 1] + b[2, 2]
            pj = pressure * det
            for a in range(10):
                for i in range(3):
                    bf = b[i, 0] * fa[a, 0] + b[i, 1] * fa[a, 1] + b[i, 2] * fa[a, 2]
                    force[elements[e, a], i] += w * (
                        (a10 + a01 * i1) * fa[a, i] - a01 * bf + (pj - d) * ha[a, i]
                    )
                    mean_gradient[a, i] += w * det / volume * ha[a, i]
            _add_stiffness(
                stiffness[e],
                gradients[e, q],
                fa,
                ha,
                b,
                w * (a10 + a01 * i1),
                w * a01,
                w * pj,
                w * (d - pj),
            )
        second = 0.5 * lame[e] * (1 + 1 / (mean * mean)) * volume
        for m in range(10):
            for n in range(m, 10):
                for i in range(3):
                    for k in range(3):
                        stiffness[e, m, n, i, k] += (
                            second * mean_gradient[m, i] * mean_gradient[n, k]
                        )
