"""Fibres in the virtual block along one direction, with exponential stiffening (Holzapfel et al.
2000).

W(F) = k / (8 c) (exp(c (|F a|^2 - 1)^2) - 1),   a the direction at rest

The fibres also resist compression, without stiffening: there W is the limit c = 0,
k/8 (|F a|^2 - 1)^2. At small strain k is added to the stiffness along a alone, from which Young's
moduli along and across follow in closed form. The constant c sets how soon the fibres stiffen; at
large strain they therefore differ from those of a replay.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

__all__ = ["CURVING", "assemble_fibres", "fibre_energy", "fibre_modulus"]

CURVING = 0.3
"""c of the fibres [1]."""
_FAST = {"contract", "reassoc", "arcp", "nsz"}


def fibre_modulus(stiffness_ratio: float, poisson_ratio: float) -> float:
    """k over E [1] of fibres that make the modulus along them `stiffness_ratio` times that across.

    Stretched along, fibres and matrix add: E_a = E + k. Stretched across, the fibres hinder the
    contraction along them, which turns 1 / E into 1 / E - k nu^2 / (E (E + k)). The ratio of both
    is 1 + k (1 - nu^2) / E.
    """
    return (stiffness_ratio - 1.0) / (1.0 - poisson_ratio**2)


@njit(cache=True, fastmath=_FAST)
def _stretch(u: Any, nodes: Any, g: Any, direction: Any, along: Any, turned: Any) -> float:
    """|F a|^2 - 1; fills `turned` with F a (3,) and `along` with each node's gradient along a (10,)
    [1/m].
    """
    for i in range(3):
        turned[i] = direction[i]
    for a in range(10):
        along[a] = g[a, 0] * direction[0] + g[a, 1] * direction[1] + g[a, 2] * direction[2]
        for i in range(3):
            turned[i] += u[nodes[a], i] * along[a]
    return float(turned[0] ** 2 + turned[1] ** 2 + turned[2] ** 2 - 1.0)


@njit(cache=True, fastmath=_FAST)
def fibre_energy(
    u: Any, elements: Any, gradients: Any, weights: Any, modulus: Any, direction: Any
) -> float:
    """Energy [J] of displacements u (n, 3) [m], for k (e, q) [Pa] and a unit direction (3,)."""
    along, turned = np.empty(10), np.empty(3)
    total = 0.0
    for e in range(elements.shape[0]):
        for q in range(weights.shape[1]):
            strain = _stretch(u, elements[e], gradients[e, q], direction, along, turned)
            square = (
                strain * strain if strain < 0 else np.expm1(CURVING * strain * strain) / CURVING
            )
            total += weights[e, q] * modulus[e, q] * square / 8
    return total


@njit(cache=True, fastmath=_FAST)
def assemble_fibres(
    u: Any,
    elements: Any,
    gradients: Any,
    weights: Any,
    modulus: Any,
    direction: Any,
    stiffness: Any,
    force: Any,
) -> None:
    """Add to element stiffness (e, 10, 10, 3, 3) [N/m], upper node pairs only, and to force (n, 3)
    [N].
    """
    along, turned = np.empty(10), np.empty(3)
    for e in range(elements.shape[0]):
        for q in range(weights.shape[1]):
            strain = _stretch(u, elements[e], gradients[e, q], direction, along, turned)
            square = CURVING * max(strain, 0.0) ** 2
            scale = weights[e, q] * modulus[e, q] * np.exp(square)
            pull = 0.5 * scale * strain
            rise = scale * (1.0 + 2.0 * square)
            for m in range(10):
                for i in range(3):
                    force[elements[e, m], i] += pull * turned[i] * along[m]
                for n in range(m, 10):
                    both = along[m] * along[n]
                    for i in range(3):
                        stiffness[e, m, n, i, i] += both * pull
                        for k in range(3):
                            stiffness[e, m, n, i, k] += both * rise * turned[i] * turned[k]
