"""Right Cauchy-Green tensors, their inverses and logarithmic strains.

Symmetric tensors are rows (6,) of xx, yy, zz, yz, xz, xy.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from palpate.foundation.arrays import FloatArray

__all__ = ["cauchy_green", "from_log_strain", "invert", "log_strain"]

_LEAST_DETERMINANT = 1e-3
"""Smallest determinant of C: between quadrature points an element may be inverted although it is
not at them."""
_NEAR = 0.03
"""Norm of the strain up to which logarithm and exponential are quotients of polynomials (Pade of
order 3 over 3). Their next terms, x^7 / 2800 and less, are below 1e-14 there, and no eigenvalues
are needed. Most of a body is strained by less."""
_LOG_ABOVE, _LOG_BELOW = (0.0, 0.5, 0.5, 11 / 120), (1.0, 1.5, 0.6, 0.05)
_EXP_ABOVE, _EXP_BELOW = (1.0, 0.5, 0.1, 1 / 120), (1.0, -0.5, 0.1, -1 / 120)


@njit(cache=True)
def cauchy_green(tangents: Any) -> Any:
    """Right Cauchy-Green tensors C (m, 6).

    Args:
        tangents: (m, 3, 3) derivatives of the positions along x, y, z, one row each [1].
    """
    result = np.empty((tangents.shape[0], 6))
    for m in range(tangents.shape[0]):
        t = tangents[m]
        for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            result[m, k] = t[i, 0] * t[j, 0] + t[i, 1] * t[j, 1] + t[i, 2] * t[j, 2]
    return result


@njit(cache=True, inline="always")
def invert(c: Any, inverse: Any) -> float:
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
def _eigen(a: Any, axes: Any) -> None:
    """Diagonalise a symmetric matrix (3, 3) by Jacobi's method.

    The eigenvalues are left on the diagonal of `a`, the eigenvectors in the columns of `axes`.
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
def _times(a: Any, b: Any, result: Any) -> None:
    """Multiply two symmetric tensors (6,) with common axes."""
    result[0] = a[0] * b[0] + a[5] * b[5] + a[4] * b[4]
    result[1] = a[5] * b[5] + a[1] * b[1] + a[3] * b[3]
    result[2] = a[4] * b[4] + a[3] * b[3] + a[2] * b[2]
    result[3] = a[5] * b[4] + a[1] * b[3] + a[3] * b[2]
    result[4] = a[0] * b[4] + a[5] * b[3] + a[4] * b[2]
    result[5] = a[0] * b[5] + a[5] * b[1] + a[4] * b[3]


@njit(cache=True, inline="always")
def _length(a: Any) -> float:
    """Frobenius norm of a symmetric tensor (6,)."""
    return float(
        np.sqrt(a[0] ** 2 + a[1] ** 2 + a[2] ** 2 + 2.0 * (a[3] ** 2 + a[4] ** 2 + a[5] ** 2))
    )


@njit(cache=True, inline="always")
def _near_one(a: Any, upper: Any, lower: Any, work: Any, result: Any) -> None:
    """Quotient of two polynomials (4,) of a symmetric tensor (6,), written into `result`.

    The coefficients are in ascending order.
    """
    square, cube, below, inverse = work[0], work[1], work[2], work[3]
    _times(a, a, square)
    _times(square, a, cube)
    for k in range(6):
        one = 1.0 if k < 3 else 0.0
        below[k] = lower[0] * one + lower[1] * a[k] + lower[2] * square[k] + lower[3] * cube[k]
        cube[k] = upper[0] * one + upper[1] * a[k] + upper[2] * square[k] + upper[3] * cube[k]
    invert(below, inverse)
    _times(cube, inverse, result)


@njit(cache=True, inline="always")
def _by_axes(t: Any, logarithm: bool, full: Any, axes: Any, result: Any) -> None:
    """Half the logarithm, or the exponential of twice a symmetric tensor (6,), by its eigenvalues.

    The result is written into `result`.
    """
    full[0, 0], full[1, 1], full[2, 2] = t[0], t[1], t[2]
    full[1, 2], full[0, 2], full[0, 1] = t[3], t[4], t[5]
    full[2, 1], full[2, 0], full[1, 0] = t[3], t[4], t[5]
    _eigen(full, axes)
    for n in range(6):
        result[n] = 0.0
    for k in range(3):
        value = (
            0.5 * np.log(max(full[k, k], _LEAST_DETERMINANT))
            if logarithm
            else np.exp(2.0 * full[k, k])
        )
        for n, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))):
            result[n] += axes[i, k] * axes[j, k] * value


@njit(cache=True)
def _logarithms(c: Any, larger_than: Any, near: float) -> Any:
    """Half the logarithm (m, 6) of tensors (m, 6), without its trace.

    It is zero where it is certainly no longer than `larger_than` (m,): |ln C| is at most that of C
    - 1 and C^-1 - 1 together, a bound that needs no eigenvalues.
    """
    result, full, axes, work = (
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
            invert(c[m], inverse)
            for k in range(3):
                inverse[k] -= 1.0
            if 0.5 * np.sqrt(size**2 + _length(inverse) ** 2) < larger_than[m]:
                continue
        if size < near:
            _near_one(away, upper, lower, work, result[m])
        else:
            _by_axes(c[m], True, full, axes, result[m])
        mean = (result[m, 0] + result[m, 1] + result[m, 2]) / 3.0
        for k in range(3):
            result[m, k] -= mean
    return result


@njit(cache=True)
def _exponentials(strain: Any, near: float) -> Any:
    """Exponential of twice the tensors (m, 6)."""
    result, full, axes, work = (
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
            _near_one(twice, upper, lower, work, result[m])
        else:
            _by_axes(strain[m], False, full, axes, result[m])
    return result


def log_strain(c: FloatArray, larger_than: FloatArray | None = None) -> FloatArray:
    """Logarithmic strain ln(C) / 2 (m, 6) without the volumetric part [1].

    Args:
        c: (m, 6).
        larger_than: (m,) [1]; strains that are certainly no longer are zero instead.
    """
    return np.asarray(
        _logarithms(c, np.zeros(len(c)) if larger_than is None else larger_than, _NEAR)
    )


def from_log_strain(strain: FloatArray) -> FloatArray:
    """The C (m, 6) of a logarithmic strain."""
    return np.asarray(_exponentials(strain, _NEAR))
