"""A tool on a compliant shaft: its equilibrium position by Newton's method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.solver.tet_equilibrium import TetState

__all__ = ["solve_compliant_shaft", "times"]

PLACED = 1e-7
"""Residual of the tool's position at which Newton's method has converged [m]."""
MOST = 25
"""Largest number of Newton steps."""
LONGEST = 1.5e-3
"""Longest Newton step [m]."""


def times(softness: FloatArray | float, load: FloatArray) -> FloatArray:
    """Return softness [m/N], a number or a matrix (3, 3), times a force (3,) or a matrix (3, 3)."""
    if isinstance(softness, np.ndarray):
        return np.asarray(softness @ load)
    return softness * load


def solve_compliant_shaft(
    stated: FloatArray,
    softness: FloatArray | float,
    place: FloatArray,
    solve: Callable[[FloatArray], TetState],
) -> TetState:
    """Solve for the state whose tool centre is `stated` plus softness times the force on the tool.

    Its stiffness is that against a motion of the stated centre. Raises SolveError without
    convergence.

    Args:
        stated: (3,) centre of the unloaded tool [m].
        softness: C [m/N]: one for all directions, or a matrix (3, 3).
        place: (3,) start of the iteration [m].
        solve: the state with the tool held at a position (3,) [m].
    """
    for _ in range(MOST):
        state = solve(place)
        miss = stated - times(softness, state.tool_force) - place
        slope = np.eye(3) + times(softness, state.contact_stiffness)
        if np.linalg.norm(miss) < PLACED:
            return replace(state, contact_stiffness=state.contact_stiffness @ np.linalg.inv(slope))
        step = np.linalg.solve(slope, miss)
        place = place + step * min(1.0, LONGEST / float(np.linalg.norm(step)))
    left = float(np.linalg.norm(miss))
    raise SolveError(
        f"the tool finds no rest on its shaft: it stands {left * 1e3:.2g} mm from where its load "
        "would put it",
        residual=left,
    )
