"""Constant stress over a time step, as a potential, and the shear stress that it comes from.

A second Piola-Kirchhoff stress H that does not change with the deformation has the energy density H
: (C - I) / 2, quadratic in the positions. So a time step of a material with history is one more
equilibrium (see `palpate.replay.material_history`), which every solver of equilibria can find. Its
tangent is H's geometric stiffness, constant over the step and in general indefinite.

Symmetric tensors are rows (6,) of xx, yy, zz, yz, xz, xy. Stresses are over the local shear
modulus, so that an inclusion's edge is in the modulus alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import scipy.sparse as sp
from numba import njit

from palpate.fem.constitutive.elastic import Law
from palpate.fem.constitutive.scatter import scatter
from palpate.fem.model import BlockModel
from palpate.foundation.arrays import FloatArray

__all__ = ["ConstantStress", "cauchy_green", "from_log_strain", "log_strain", "shear_stress"]

_LEAST_DETERMINANT, _MOST_HARDENING = 1e-3, 50.0
"""Smallest determinant of C, and largest hardening: between quadrature points an element may be
inverted or beyond Gent's limit although it is not at them; there the stress stops growing."""
_NEAR = 0.03
"""Distance from no strain up to which logarithm and exponential are quotients of polynomials (Pade
of order 3 over 3): their next terms, x^7 / 2800 and less, are below 1e-14 there, and no eigenvalues
are sought. Most of a body is strained by less."""
_LOG_ABOVE, _LOG_BELOW = (0.0, 0.5, 0.5, 11 / 120), (1.0, 1.5, 0.6, 0.05)
_EXP_ABOVE, _EXP_BELOW = (1.0, 0.5, 0.1, 1 / 120), (1.0, -0.5, 0.1, -1 / 120)


@njit(cache=True)
def cauchy_green(tangents: Any) -> Any:
    """Right Cauchy-Green tensors C (m, 6).

    Args:
        tangents: (m, 3, 3) derivatives of the positions along x, y, z, one row each [1].
    """
    found = np.empty((tangents.shape[0], 6))
    for m in range(tangents.shape[0]):
        t = tangents[m]
        for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            found[m, k] = t[i, 0] * t[j, 0] + t[i, 1] * t[j, 1] + t[i, 2] * t[j, 2]
    return found


@njit(cache=True, inline="always")
def _invert(c: Any, inverse: Any) -> float:
    """Write C^-1 into `inverse` (6,); returns the determinant."""
    inverse[0], inverse[1], inverse[2] = (
        c[1] * c[2] - c[3] * c[3],
        c[0] * c[2] - c[4] * c[4],
        c[0] * c[1] - c[5] * c[5],
    )
    inverse[3], inverse[4], inverse[5] = (
        c[4] * c[5] - c[0] * c[3],
        c[3] * c[5] - c[1] * c[4],
        c[3] * c[4] - c[2] * c[5],
    )
    det = max(c[0] * inverse[0] + c[5] * inverse[5] + c[4] * inverse[4], _LEAST_DETERMINANT)
    for k in range(6):
        inverse[k] /= det
    return det  # type: ignore[no-any-return]


@njit(cache=True)
def _shear_stress(c: Any, stiffening: float, gamma: float, direction: Any) -> Any:
    found, inverse = np.empty(c.shape), np.empty(6)
    a0, a1 = direction[0], direction[1]
    for m in range(c.shape[0]):
        trace = c[m, 0] + c[m, 1] + c[m, 2]
        root = np.cbrt(_invert(c[m], inverse))
        left = 1.0 - stiffening * (trace / root - 3.0)
        scale = min(1.0 / left, _MOST_HARDENING) / root if left > 0.0 else _MOST_HARDENING / root
        for k in range(6):
            found[m, k] = scale * ((1.0 if k < 3 else 0.0) - trace / 3.0 * inverse[k])
        if gamma > 0.0:
            pull = (
                2.0
                * gamma
                * (c[m, 0] * a0 * a0 + c[m, 1] * a1 * a1 + 2.0 * c[m, 5] * a0 * a1 - 1.0)
            )
            found[m, 0] += pull * a0 * a0
            found[m, 1] += pull * a1 * a1
            found[m, 5] += pull * a0 * a1
    return found


def shear_stress(law: Law, c: FloatArray) -> FloatArray:
    """Second Piola-Kirchhoff stress without the pressure, over the shear modulus (m, 6) [1].

    J^(-2/3) (I - tr C / 3 C^-1) / (1 - k x), k = 1 / J_m, and with fibres 2 gamma (I4 - 1) a a'.
    """
    return np.asarray(_shear_stress(c, law.stiffening, law.gamma, law.direction))


@njit(cache=True)
def _eigen(a: Any, axes: Any) -> None:
    """Turn a symmetric matrix (3, 3) to its eigenvalues on the diagonal, the eigenvectors as
    columns of `axes`; by Jacobi.
    """
    axes[:] = np.eye(3)
    for _ in range(12):
        if a[0, 1] ** 2 + a[0, 2] ** 2 + a[1, 2] ** 2 < 1e-32 * (
            a[0, 0] ** 2 + a[1, 1] ** 2 + a[2, 2] ** 2
        ):
            break
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if a[p, q] == 0.0:
                continue
            ratio = (a[q, q] - a[p, p]) / (2.0 * a[p, q])
            t = (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + np.sqrt(ratio * ratio + 1.0))
            c = 1.0 / np.sqrt(t * t + 1.0)
            s = t * c
            for k in range(3):
                a[k, p], a[k, q] = c * a[k, p] - s * a[k, q], s * a[k, p] + c * a[k, q]
                axes[k, p], axes[k, q] = (
                    c * axes[k, p] - s * axes[k, q],
                    s * axes[k, p] + c * axes[k, q],
                )
            for k in range(3):
                a[p, k], a[q, k] = c * a[p, k] - s * a[q, k], s * a[p, k] + c * a[q, k]


@njit(cache=True, inline="always")
def _times(a: Any, b: Any, found: Any) -> None:
    """The product (6,) of two symmetric tensors (6,) that have their axes in common."""
    found[0] = a[0] * b[0] + a[5] * b[5] + a[4] * b[4]
    found[1] = a[5] * b[5] + a[1] * b[1] + a[3] * b[3]
    found[2] = a[4] * b[4] + a[3] * b[3] + a[2] * b[2]
    found[3] = a[5] * b[4] + a[1] * b[3] + a[3] * b[2]
    found[4] = a[0] * b[4] + a[5] * b[3] + a[4] * b[2]
    found[5] = a[0] * b[5] + a[5] * b[1] + a[4] * b[3]


@njit(cache=True, inline="always")
def _length(a: Any) -> float:
    """Frobenius norm of a symmetric tensor (6,)."""
    return float(
        np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2 + 2.0 * (a[3] ** 2 + a[4] ** 2 + a[5] ** 2))
    )


@njit(cache=True, inline="always")
def _near_one(a: Any, upper: Any, lower: Any, work: Any, found: Any) -> None:
    """A quotient of two polynomials (4,), from the constant on, of a symmetric tensor (6,), into
    `found`.
    """
    square, cube, below, inverse = work[0], work[1], work[2], work[3]
    _times(a, a, square)
    _times(square, a, cube)
    for k in range(6):
        one = 1.0 if k < 3 else 0.0
        below[k] = lower[0] * one + lower[1] * a[k] + lower[2] * square[k] + lower[3] * cube[k]
        cube[k] = upper[0] * one + upper[1] * a[k] + upper[2] * square[k] + upper[3] * cube[k]
    _invert(below, inverse)
    _times(cube, inverse, found)


@njit(cache=True, inline="always")
def _by_axes(t: Any, logarithm: bool, full: Any, axes: Any, found: Any) -> None:
    """Half the logarithm, or the exponential of twice, of a symmetric tensor (6,) by its
    eigenvalues, into `found`.
    """
    full[0, 0], full[1, 1], full[2, 2] = t[0], t[1], t[2]
    full[1, 2], full[0, 2], full[0, 1] = t[3], t[4], t[5]
    full[2, 1], full[2, 0], full[1, 0] = t[3], t[4], t[5]
    _eigen(full, axes)
    for n in range(6):
        found[n] = 0.0
    for k in range(3):
        value = (
            0.5 * np.log(max(full[k, k], _LEAST_DETERMINANT))
            if logarithm
            else np.exp(2.0 * full[k, k])
        )
        for n, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            found[n] += axes[i, k] * axes[j, k] * value


@njit(cache=True)
def _logarithms(c: Any, larger_than: Any, near: float) -> Any:
    """Half the logarithm (m, 6) without its trace of tensors (m, 6), zero where it is surely no
    longer than `larger_than` (m,).

    |ln C| is at most that of C - 1 and of C^-1 - 1 together, which no eigenvalue is needed for.
    """
    found, full, axes, work = (
        np.zeros(c.shape),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((4, 6)),
    )
    upper, lower, away, inverse = (
        np.array(_LOG_ABOVE),
        np.array(_LOG_BELOW),
        np.empty(6),
        np.empty(6),
    )
    for m in range(c.shape[0]):
        for k in range(6):
            away[k] = c[m, k] - (1.0 if k < 3 else 0.0)
        size = _length(away)
        if larger_than[m] > 0.0:
            _invert(c[m], inverse)
            for k in range(3):
                inverse[k] -= 1.0
            if 0.5 * np.sqrt(size**2 + _length(inverse) ** 2) < larger_than[m]:
                continue
        if size < near:
            _near_one(away, upper, lower, work, found[m])
        else:
            _by_axes(c[m], True, full, axes, found[m])
        mean = (found[m, 0] + found[m, 1] + found[m, 2]) / 3.0
        for k in range(3):
            found[m, k] -= mean
    return found


@njit(cache=True)
def _exponentials(strain: Any, near: float) -> Any:
    """The exponential of twice the tensors (m, 6)."""
    found, full, axes, work = (
        np.empty(strain.shape),
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty((4, 6)),
    )
    upper, lower, twice = np.array(_EXP_ABOVE), np.array(_EXP_BELOW), np.empty(6)
    for m in range(strain.shape[0]):
        for k in range(6):
            twice[k] = 2.0 * strain[m, k]
        if _length(twice) < near:
            _near_one(twice, upper, lower, work, found[m])
        else:
            _by_axes(strain[m], False, full, axes, found[m])
    return found


def log_strain(c: FloatArray, larger_than: FloatArray | None = None) -> FloatArray:
    """Logarithmic strain ln(C) / 2 (m, 6) without the part in the volume [1].

    With sizes `larger_than` (m,) [1] given, strains that are surely no longer than that are zero
    instead.
    """
    return np.asarray(
        _logarithms(c, np.zeros(len(c)) if larger_than is None else larger_than, _NEAR)
    )


def from_log_strain(strain: FloatArray) -> FloatArray:
    """The C (m, 6) of a logarithmic strain."""
    return np.asarray(_exponentials(strain, _NEAR))


@njit(cache=True)
def _add(
    gradients: Any, weights: Any, nodes: Any, stress: Any, slots: Any, load: Any, data: Any
) -> None:
    """Subtract the forces at rest from `load` and add the tangent to `data`.

    Args:
        gradients: (e, q, a, 3) [1/m].
        weights: (e, q) [m^3].
        nodes: (e, a).
        stress: (e, q, 6) over E [1].
        slots: as in `assemble_elastic`.
        load: (n, 3) [m^2].
        data: [m].
    """
    corners = nodes.shape[1]
    matrix, pulled = np.empty((3 * corners, 3 * corners)), np.empty((corners, 3))
    for e in range(nodes.shape[0]):
        matrix[:] = 0.0
        for q in range(weights.shape[1]):
            g, h, w = gradients[e, q], stress[e, q], weights[e, q]
            for a in range(corners):
                pulled[a, 0] = w * (h[0] * g[a, 0] + h[5] * g[a, 1] + h[4] * g[a, 2])
                pulled[a, 1] = w * (h[5] * g[a, 0] + h[1] * g[a, 1] + h[3] * g[a, 2])
                pulled[a, 2] = w * (h[4] * g[a, 0] + h[3] * g[a, 1] + h[2] * g[a, 2])
                for i in range(3):
                    load[nodes[e, a], i] -= pulled[a, i]
            for a in range(corners):
                for b in range(a, corners):
                    share = pulled[a, 0] * g[b, 0] + pulled[a, 1] * g[b, 1] + pulled[a, 2] * g[b, 2]
                    for i in range(3):
                        matrix[3 * a + i, 3 * b + i] += share
        scatter(matrix, slots[e], data)


@dataclass(frozen=True, eq=False)
class ConstantStress:
    """Energy H : (C - I) / 2 over the body as a quadratic form of the unknowns' displacements d
    (u,).

    It is 1/2 d' Q d - b' d, over E.

    Attributes:
        upper: upper triangle and diagonal of Q [m].
        data: its entries in the tangent's pattern.
        load: b (u,) [m^2].
    """

    upper: sp.csr_matrix
    data: FloatArray
    load: FloatArray

    @classmethod
    def of(cls, model: BlockModel, stress: FloatArray) -> Self:
        """Make the potential of the stress H over E (e, q, 6) [1] at the model's quadrature
        points.
        """
        top = model.topology
        load, data = np.zeros_like(model.mesh.nodes), np.zeros(top.pattern.nnz)
        _add(model.rule.gradients, model.rule.weights, top.elements, stress, top.slots, load, data)
        upper = sp.csr_matrix(
            (data, top.pattern.indices, top.pattern.indptr), shape=top.pattern.shape
        )
        return cls(upper, data, load[top.free])

    def _turned(self, displacement: FloatArray) -> FloatArray:
        whole = (
            self.upper @ displacement
            + self.upper.T @ displacement
            - self.upper.diagonal() * displacement
        )
        return np.asarray(whole)

    def energy(self, displacement: FloatArray) -> float:
        """Energy over E [m^3]."""
        return float(displacement @ (0.5 * self._turned(displacement) - self.load))

    def force(self, displacement: FloatArray) -> FloatArray:
        """Gradient of the energy over E (u,) [m^2]."""
        return np.asarray(self._turned(displacement) - self.load)
