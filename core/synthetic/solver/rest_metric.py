"""Energy of a changed rest metric, which a material with a history adds to the base law.

W(F) = w/2 (J^(-2/3) G : F'F - tr G)

with a symmetric natural metric G (1 at rest) that is constant during an equilibrium. The stress is
deviatoric for any G; with G = 1 the law is neo-Hookean.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.mooney_rivlin import deformation_gradient, turn_gradients

__all__ = ["assemble_metric", "isochoric", "metric_energy"]

_FAST = {"contract", "reassoc", "arcp", "nsz"}


@njit(cache=True, fastmath=_FAST)
def metric_energy(
    u: Any, elements: Any, gradients: Any, weights: Any, shear: Any, metric: Any
) -> float:
    """Energy [J] of displacements u (n, 3) [m], for shear moduli (e, q) [Pa] and metrics (e, q, 3,
    3) [1].
    """
    f = np.empty((3, 3))
    total = 0.0
    for e in range(elements.shape[0]):
        for q in range(weights.shape[1]):
            det = deformation_gradient(u, elements[e], gradients[e, q], f)
            if det <= 1e-3:
                return np.inf
            g = metric[e, q]
            stretched = 0.0
            for i in range(3):
                for k in range(3):
                    stretched += g[i, k] * (
                        f[0, i] * f[0, k] + f[1, i] * f[1, k] + f[2, i] * f[2, k]
                    )
            total += (
                0.5
                * weights[e, q]
                * shear[e, q]
                * (stretched / np.cbrt(det * det) - g[0, 0] - g[1, 1] - g[2, 2])
            )
    return total


@njit(cache=True, fastmath=_FAST)
def assemble_metric(
    u: Any,
    elements: Any,
    gradients: Any,
    weights: Any,
    shear: Any,
    metric: Any,
    stiffness: Any,
    force: Any,
) -> None:
    """Add to element stiffness (e, 10, 10, 3, 3) [N/m], upper node pairs only, and to force (n, 3)
    [N].
    """
    f = np.empty((3, 3))
    fa = np.empty((10, 3))
    ga = np.empty((10, 3))
    ha = np.empty((10, 3))
    for e in range(elements.shape[0]):
        for q in range(weights.shape[1]):
            g = gradients[e, q]
            det = deformation_gradient(u, elements[e], g, f)
            scale = 1.0 / np.cbrt(det * det)
            pull = weights[e, q] * shear[e, q] * scale
            first = 0.0
            for i in range(3):
                for k in range(3):
                    first += metric[e, q, i, k] * (
                        f[0, i] * f[0, k] + f[1, i] * f[1, k] + f[2, i] * f[2, k]
                    )
            for a in range(10):
                for i in range(3):
                    ga[a, i] = (
                        metric[e, q, i, 0] * g[a, 0]
                        + metric[e, q, i, 1] * g[a, 1]
                        + metric[e, q, i, 2] * g[a, 2]
                    )
            turn_gradients(f, ga, g, fa, ha)
            for a in range(10):
                for i in range(3):
                    force[elements[e, a], i] += pull * (fa[a, i] - first / 3.0 * ha[a, i])
            for m in range(10):
                for n in range(m, 10):
                    plain = pull * (g[m, 0] * ga[n, 0] + g[m, 1] * ga[n, 1] + g[m, 2] * ga[n, 2])
                    for i in range(3):
                        for k in range(3):
                            bend = first * (
                                2.0 / 9.0 * ha[m, i] * ha[n, k] + 1.0 / 3.0 * ha[n, i] * ha[m, k]
                            )
                            bend -= 2.0 / 3.0 * (ha[m, i] * fa[n, k] + fa[m, i] * ha[n, k])
                            stiffness[e, m, n, i, k] += pull * bend
                        stiffness[e, m, n, i, i] += plain


@njit(cache=True)
def isochoric(u: Any, elements: Any, gradients: Any) -> FloatArray:
    """J^(-2/3) F'F (e, q, 3, 3) [1] of displacements u (n, 3) [m]."""
    found = np.empty((gradients.shape[0], gradients.shape[1], 3, 3))
    f = np.empty((3, 3))
    for e in range(gradients.shape[0]):
        for q in range(gradients.shape[1]):
            det = deformation_gradient(u, elements[e], gradients[e, q], f)
            found[e, q] = f.T @ f / np.cbrt(det * det)
    return found
