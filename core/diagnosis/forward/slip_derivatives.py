"""First-order changes of the slip of a base.

While the base slides, the force F on the tool stays at what friction holds: g(F) = |F_xy| - mu (W +
F_z) = 0 (Coulomb). A change by dp therefore moves the base by dl along the push such that dg = 0. A
tool that reaches a tenth of a millimetre further into a side moves the whole block by as much; a
base that is taken to be fixed shows nothing of that. The slip stays after the push.
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

__all__ = ["SlipTangent"]


class SlipTangent:
    """Follows one replay in order of time and adds up the changes of the slip.

    Args:
        setup: of the replay, with a base that slides.
        others: setups that differ a little.
        steps: size of each difference.
        first: number of the first of these changes. Those before it are changes of the tool, the
            motion along x, y and z first.
        count: number of changes.
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
        """Return whether the base slides in this frame."""
        moved = float(np.linalg.norm(frame.slip - self._at))
        return (
            frame.outcome is Outcome.CONVERGED
            and frame.in_contact
            and moved > CRITERIA.derivatives.least_slip
        )

    def after(self, frame: Equilibrium, changes: FloatArray) -> FloatArray:
        """Return the changes of the nodes [m] and of the force [N] (k, n + 1, 3) with the slip in
        them.

        Args:
            frame: next in order of time.
            changes: the same with a base that is fixed.
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
        """Update the changes of the slip.

        Args:
            force: on the tool (3,) [N].
            changes: of the force (k, 3) [N].
            tool: change of the force by a motion of the tool along each axis (3, 3) [N/m].
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
