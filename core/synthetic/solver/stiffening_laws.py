"""Strain stiffening of the virtual block, added to the base law.

Gent's stretch limit:     W(F) = mu/2 (-J_m ln(1 - x / J_m) - x),   x = J^(-2/3) I1 - 3
Exponential (Fung 1967):  W(F) = mu/2 (J_m (exp(x / J_m) - 1) - x)

The base law is not changed. The added energy begins with mu x^2 / (4 J_m), as Gent's law exceeds
the neo-Hookean one, and is infinite at x = J_m. The exponential law begins alike and has no limit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.synthetic.solver.mooney_rivlin import deformation_gradient, turn_gradients

__all__ = ["assemble_stiffening", "stiffening_energy"]

_FAST = {"contract", "reassoc", "arcp", "nsz"}


@njit(cache=True, fastmath=_FAST)
def stiffening_energy(
    u: Any,
    elements: Any,
    gradients: Any,
    weights: Any,
    shear: Any,
    limit: float,
    exponential: bool = False,
) -> float:
    """Energy [J] of displacements u (n, 3) [m], for shear moduli (e, q) [Pa] and J_m [1]; infinite
    beyond the limit of Gent's law.
    """
    f = np.empty((3, 3))
    total = 0.0
    for e in range(elements.shape[0]):
        for q in range(weights.shape[1]):
            det = deformation_gradient(u, elements[e], gradients[e, q], f)
            x = (f * f).sum() / np.cbrt(det * det) - 3.0
            if exponential:
                total += 0.5 * weights[e, q] * shear[e, q] * (limit * np.expm1(x / limit) - x)
                continue
            if x >= limit:
                return np.inf
            total += 0.5 * weights[e, q] * shear[e, q] * (-limit * np.log1p(-x / limit) - x)
    return total


@njit(cache=True, fastmath=_FAST)
def assemble_stiffening(
    u: Any,
    elements: Any,
    gradients: Any,
    weights: Any,
    shear: Any,
    limit: float,
    stiffness: Any,
    force: Any,
    exponential: bool = False,
) -> None:
    """Add to element stiffness (e, 10, 10, 3, 3) [N/m], upper node pairs only, and to force (n, 3)
    [N].

    No point may be stretched to the limit or turned inside out.
    """
    f = np.empty((3, 3))
    fa = np.empty((10, 3))
    ha = np.empty((10, 3))
    xa = np.empty((10, 3))
    for e in range(elements.shape[0]):
        for q in range(weights.shape[1]):
            g = gradients[e, q]
            det = deformation_gradient(u, elements[e], g, f)
            turn_gradients(f, g, g, fa, ha)
            scale = 1.0 / np.cbrt(det * det)
            i1 = (f * f).sum()
            share = (scale * i1 - 3.0) / limit
            if exponential:
                first = 0.5 * weights[e, q] * shear[e, q] * np.expm1(share)
                second = 0.5 * weights[e, q] * shear[e, q] / limit * np.exp(share)
            else:
                first = 0.5 * weights[e, q] * shear[e, q] * share / (1.0 - share)
                second = 0.5 * weights[e, q] * shear[e, q] / (limit * (1.0 - share) ** 2)
            for a in range(10):
                for i in range(3):
                    xa[a, i] = 2.0 * scale * (fa[a, i] - i1 / 3.0 * ha[a, i])
                    force[elements[e, a], i] += first * xa[a, i]
            for m in range(10):
                for n in range(m, 10):
                    alpha = g[m, 0] * g[n, 0] + g[m, 1] * g[n, 1] + g[m, 2] * g[n, 2]
                    for i in range(3):
                        for k in range(3):
                            bend = i1 * (
                                4.0 / 9.0 * ha[m, i] * ha[n, k] + 2.0 / 3.0 * ha[n, i] * ha[m, k]
                            )
                            bend -= 4.0 / 3.0 * (ha[m, i] * fa[n, k] + fa[m, i] * ha[n, k])
                            if i == k:
                                bend += 2.0 * alpha
                            stiffness[e, m, n, i, k] += (
                                second * xa[m, i] * xa[n, k] + first * scale * bend
                            )
