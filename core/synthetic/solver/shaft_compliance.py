"""A tool whose shaft gives way: where its centre truly comes to rest, by Newton's method on the
three numbers of its place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SolveError
from palpate.synthetic.solver.tet_equilibrium import State

__all__ = ["give_way"]

PLACED = 1e-7
MOST = 25
LONGEST = 1.5e-3


def give_way(
    stated: FloatArray, softness: float, place: FloatArray, solve: Callable[[FloatArray], State]
) -> State:
    """The state whose centre is `stated` plus softness times the force on the tool; it answers to a
    motion of the stated centre.

    Args:
        stated: (3,) [m].
        softness: C [m/N].
        place: (3,) to begin from [m].
        solve: the state with the tool held at a place.

    Raises SolveError where no such place is found.
    """
    for _ in range(MOST):
        state = solve(place)
        miss = stated - softness * state.push - place
        slope = np.eye(3) + softness * state.compliance
        if np.linalg.norm(miss) < PLACED:
            return replace(state, compliance=state.compliance @ np.linalg.inv(slope))
        step = np.linalg.solve(slope, miss)
        place = place + step * min(1.0, LONGEST / float(np.linalg.norm(step)))
    text = f"the tool finds no rest on its shaft: it stands {np.linalg.norm(miss) * 1e3:.2g} mm from where its load would put it"
    raise SolveError(text, residual=float(np.linalg.norm(miss)))
