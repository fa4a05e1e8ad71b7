"""One move of a base that slides on the table, linearised and transposed: it goes with the force on the tool, and the dent."""

from __future__ import annotations

import numpy as np

from core.equilibrium import Equilibrium
from core.errors import SolveError
from core.frames import FloatArray
from core.setup import Setup
from core.yielding import nearest_node, reach_of, slide_by, weight_of

__all__ = ["SlideStep"]

_STEP = 1e-6
"""In central differences, of a force and a length, over them."""


def _slid(force: FloatArray, reach: float, setup: Setup) -> FloatArray:
    """How far a base moves on (2,) [m] that is known to."""
    friction = setup.support.friction_coefficient
    if friction is None:
        raise SolveError("a base that slid is held in the other setup, so that there is no gradient")
    return slide_by(force, reach, friction, weight_of(setup))


class SlideStep:
    """The move that follows a frame.

    Attributes:
        slope: of what the costate is of, by the displacements (n, 3) of the frame. centre: by the tool's centre (3,), as the slid
            block sees it.
    """

    def __init__(
        self, frame: Equilibrium, setup: Setup, costate: FloatArray, slopes: tuple[FloatArray, FloatArray], free: FloatArray
    ) -> None:
        """`costate` is that of where the base has slid to (2,); `slopes` are the tool's, as `core.sensitivity.tool_slopes` has
        them, and `free` (n, 3) the coordinates that are unknowns."""
        coupling, pushed = slopes
        self._costate, self._reach, self._move = costate, reach_of(frame), _slid(frame.force, reach_of(frame), setup)
        size = _STEP * float(np.linalg.norm(frame.force))
        by_force = [self._slope(frame.force, size * axis, 0.0, setup) / size for axis in np.eye(3)]
        pulled = -setup.material.young_modulus * np.array(by_force)
        self.slope, self.centre = np.zeros_like(frame.displacement), pushed.T @ pulled
        self.slope[free] = coupling @ pulled
        if self._reach > 0:
            node, size = nearest_node(frame), _STEP * self._reach
            by_reach = self._slope(frame.force, np.zeros(3), size, setup) / size
            self.slope[node, :2] += by_reach * frame.displacement[node, :2] / self._reach

    def _slope(self, force: FloatArray, pull: FloatArray, further: float, setup: Setup) -> float:
        """Of what the costate is of, by that much more force (3,) [N] and reach [m]."""
        ahead, behind = (_slid(force + sign * pull, self._reach + sign * further, setup) for sign in (1, -1))
        return float(self._costate @ (ahead - behind)) / 2

    def agreement(self, force: FloatArray, setup: Setup) -> float:
        """The costate times how far another setup, with this force on the tool (3,) [N], moves the base beyond this one."""
        return float(self._costate @ (_slid(force, self._reach, setup) - self._move))
