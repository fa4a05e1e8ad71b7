"""Quasi-Newton correction of steps with a linearisation that is kept (multi-secant method).

With H the inverse of the kept tangent and D its error, a plain step is p = -H r and the right one
e = p - H D e. Each step s that was made shows -H D s in the plain step that follows it. So -H D is
known on the span of the steps that were made, and e follows from a small system. (Anderson's method
in the form of Fang and Saad 2009, Numer. Linear Algebra Appl. 16, for steps instead of residuals.)
"""

from __future__ import annotations

import numpy as np
from numpy.linalg import LinAlgError

from palpate.foundation.arrays import FloatArray

__all__ = ["SecantPairs"]

_MOST = 8
_DEPENDENT = 1e-4
"""Added to the squared lengths of unit steps, so that steps which are nearly combinations of the
others count little [1]."""
_LARGEST = 3.0
"""Largest correction over the plain step [1]; beyond it the steps made say nothing of this one."""


class SecantPairs:
    """Steps that were made with one linearisation, and the tangent's error along them."""

    def __init__(self) -> None:
        self._steps: list[FloatArray] = []
        self._errors: list[FloatArray] = []
        self._last: tuple[FloatArray, FloatArray] | None = None

    def begin(self) -> None:
        """Begin another sequence of steps: the next one does not follow the last."""
        self._last = None

    def corrected(self, plain: FloatArray) -> FloatArray:
        """The step (u,) to make in place of a plain one (u,) [m]."""
        if self._last is not None:
            step, correction = self._last
            self._add(step, plain + correction)
        correction = self._correction(plain)
        self._last = plain + correction, correction
        return self._last[0]

    def _add(self, step: FloatArray, error: FloatArray) -> None:
        """Store a step (u,), and -H D of it (u,)."""
        size = float(np.linalg.norm(step))
        if size:
            self._steps.append(step / size)
            self._errors.append(error / size)
            del self._steps[:-_MOST], self._errors[:-_MOST]

    def _correction(self, plain: FloatArray) -> FloatArray:
        """-H D e (u,) of the right step e, as far as the stored steps tell."""
        nothing = np.zeros_like(plain)
        if not self._steps:
            return nothing
        steps, errors = np.array(self._steps), np.array(self._errors)
        lengths = steps @ steps.T + _DEPENDENT * np.eye(len(steps))
        try:
            shares = np.linalg.solve(lengths - steps @ errors.T, steps @ plain)
        except LinAlgError:
            return nothing
        correction = shares @ errors
        fits = np.linalg.norm(correction) <= _LARGEST * np.linalg.norm(plain)
        return np.asarray(correction) if fits else nothing
