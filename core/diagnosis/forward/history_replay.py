"""Replays in which each group depends on the frames before it: material history, tool friction.

Groups are few and far apart in time. Between two of them the replay follows the tool's path in
steps that are short enough for a drag, a hold, and the rest after a release.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.frame_groups import FAR, Observations
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.phantom_geometry import CLEARANCE
from palpate.setup.setup import Setup

__all__ = ["HistoryReplay", "longest_step", "without_history"]


def without_history(setup: Setup) -> Setup:
    """Return the setup without what makes a frame depend on the frames before it."""
    material = replace(setup.material, relaxation=(), retained_fraction=0.0)
    return replace(setup, material=material, tool=replace(setup.tool, friction_coefficient=0.0))


def longest_step(setup: Setup) -> float:
    """Return the longest motion between two places of a replay along the path [m]."""
    return (
        CRITERIA.history.travel if setup.material.has_history else CRITERIA.history.friction_travel
    )


class HistoryReplay:
    """Replays a block from group to group in order of time.

    Args:
        data: the sequence.
        block: its replay, whose setup has history.
        moved: stated to true places of the tool.

    Attributes:
        solves: number of equilibria that were solved.
    """

    def __init__(self, data: Observations, block: Replay, moved: Transform) -> None:
        self._block, self._last, self._left = block, -np.inf, -np.inf
        self._travel, self.solves = longest_step(block.setup), 0
        self._frame: Equilibrium | None = None
        self._times, way = data.path(block.setup)
        self._way = moved.apply(way)
        self._near = block.setup.geometry.distance(self._way) < block.setup.tool.radius + CLEARANCE

    def reach(self, centre: FloatArray, time: float | None) -> Equilibrium:
        """Return the equilibrium with the tool at a place, after everything that came before.

        Args:
            centre: stated centre of the tool (3,) [m].
            time: of the group [s]; None for a block that has been at rest for long.
        """
        if time is None:
            return self._block.step(FAR, None, float(self._times[0]) - 1.0)
        for number in self._places(time):
            self._last = float(self._times[number])
            self._step(self._way[number], self._last)
        self._last = max(time, self._last)
        return self._step(centre, self._last)

    def _step(self, centre: FloatArray, time: float) -> Equilibrium:
        self.solves += 1
        frame = self._block.solve_from_any(centre, (self._frame,), time)
        if frame.outcome is Outcome.CONVERGED:
            self._frame = frame
        return frame

    def _places(self, until: float) -> list[int]:
        """Return the numbers of the places to pass before a time [s]."""
        found: list[int] = []
        last = int(np.searchsorted(self._times, self._last)) if np.isfinite(self._last) else 0
        for number in range(last, int(np.searchsorted(self._times, until))):
            far = float(np.linalg.norm(self._way[number] - self._way[last]))
            long = self._times[number] - self._times[last]
            if self._near[number]:
                needed = far > self._travel or long > CRITERIA.history.hold or not self._near[last]
                self._left = float(self._times[number])
            else:
                away = self._times[last] - self._left
                needed = np.isfinite(self._left) and (
                    self._near[last]
                    or long > max(CRITERIA.history.hold, CRITERIA.history.rest_growth * away)
                )
            if needed:
                found.append(number)
                last = number
        return found
