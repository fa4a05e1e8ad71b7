"""How far a base that slides goes, to first order: what presses harder slides it further, and where
it has gone it stays.

While it slides the force F on the tool stays at what friction holds, g(F) = |F_xy| - mu (W + F_z) =
0 (Coulomb). So a change by dp moves it by dl along the push such that dg = 0: a tool that reaches a
tenth of a millimetre further into a side moves the whole block by as much, of which nothing shows
in a base that is taken to stay where it is.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.replay.compliance_and_slip import weight_of
from palpate.replay.replay import Equilibrium
from palpate.setup.setup import Setup

__all__ = ["Sliding"]


class Sliding:
    """Follows one replay in the order of time and keeps how much further the base goes with each of
    `count` changes.

    Args:
        setup: of the replay, with a base that slides.
        others, steps: setups that differ a little, and by how much; the changes from number `first`
            on. Before them are those of the tool, first of all its motion along x, y and z.
    """

    def __init__(
        self, setup: Setup, others: Sequence[Setup], steps: Sequence[float], first: int, count: int
    ) -> None:
        friction = setup.support.friction_coefficient
        assert friction is not None
        self._friction, self._weight, self._at = friction, weight_of(setup), np.zeros(2)
        self._further = np.zeros((count, 2))
        self._rougher, self._heavier = np.zeros(count), np.zeros(count)
        for number, (other, step) in enumerate(zip(others, steps, strict=True), first):
            held = other.support.friction_coefficient
            self._rougher[number] = 0.0 if held is None else (held - friction) / step
            self._heavier[number] = (weight_of(other) - self._weight) / step

    def slid(self, frame: Equilibrium) -> bool:
        """Whether the base moves on in this frame."""
        moved = float(np.linalg.norm(frame.slip - self._at))
        return (
            frame.outcome is Outcome.CONVERGED
            and frame.in_contact
            and moved > CRITERIA.derivatives.least_slip
        )

    def after(self, frame: Equilibrium, changes: FloatArray) -> FloatArray:
        """Changes (k, n + 1, 3) of the nodes [m] and of the force [N], from those with a base that
        stays where it is.
        """
        tool = changes[:3]
        if self.slid(frame):
            self._slide(frame.force, changes[:, -1], tool[:, -1])
            self._at = frame.slip
        # A block that went on is as if the tool had been drawn back, and all of it moved.
        further = np.pad(self._further, [(0, 0), (0, 1)])
        found = changes - np.tensordot(further, tool, axes=1)
        found[:, :-1] += further[:, None]
        return found

    def _slide(self, force: FloatArray, changes: FloatArray, tool: FloatArray) -> None:
        """Go on, by the force (3,) on the tool [N], its changes (k, 3), and those per motion of the
        tool along each axis (3, 3).
        """
        pull = float(np.linalg.norm(force[:2]))
        if pull == 0.0:
            return
        way, slope = (
            -force[:2] / pull,
            np.array([force[0] / pull, force[1] / pull, -self._friction]),
        )
        excess = (changes - self._further @ tool[:2]) @ slope
        excess -= self._rougher * (self._weight + force[2]) + self._friction * self._heavier
        relief = float(way @ tool[:2] @ slope)
        if relief > 0.0:
            self._further = self._further + np.outer(excess / relief, way)
