"""Touches of landmarks, found as dwells of the tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, islice

import numpy as np

from palpate.dataset.tool_motion import averaged_path
from palpate.foundation.arrays import FloatArray
from palpate.importing.timed_recording import TimedRecording
from palpate.registration.robot.robot_fit import rigid_fits

__all__ = ["Dwells", "FoundTouches", "find_dwells", "find_touches"]

STILL = 0.001
"""Speed below which the tool stands still [m/s]."""
LEAST_DWELL = 0.7
"""Least time of standing still that marks a touch [s]."""
FARTHEST = 0.002
"""RMS of dwells about their landmarks up to which they are taken as touches [m]; a person touches
to a millimetre."""
CLEAR = 2.0
"""Ratio of the second best RMS to the best from which the choice is unambiguous [1]."""
_MOST = 200_000
"""Choices of dwells that are tried."""


@dataclass(frozen=True, eq=False)
class Dwells:
    """Stretches of a recording in which the tool stands still.

    Attributes:
        starts: (m,) [s].
        ends: (m,) [s].
        middles: (m,) mean times [s].
        places: (m, 3) tool centres [m], robot frame.
    """

    starts: FloatArray
    ends: FloatArray
    middles: FloatArray
    places: FloatArray


@dataclass(frozen=True, eq=False)
class FoundTouches:
    """Dwells taken as touches.

    Attributes:
        names: of the landmarks.
        positions: (n, 3) tool centres [m], robot frame.
        times: (n,) middles of the dwells [s].
        rms: of the dwells about their landmarks [m].
        second: RMS of the second best choice [m]; infinite where there is no other.
    """

    names: tuple[str, ...]
    positions: FloatArray
    times: FloatArray
    rms: float
    second: float

    @property
    def is_clear(self) -> bool:
        """Whether the choice fits, and no other nearly as well."""
        return self.rms < FARTHEST and self.second > CLEAR * max(self.rms, 1e-4)


def find_dwells(recording: TimedRecording) -> Dwells:
    """Find where the tool stands still."""
    time, path = averaged_path(recording.time, recording.positions)
    if len(time) < 2:
        return Dwells(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros((0, 3)))
    speed = np.linalg.norm(np.gradient(path, axis=0), axis=1) / np.gradient(time)
    still = np.concatenate([[False], speed < STILL, [False]])
    starts, stops = (
        np.flatnonzero(np.diff(still.astype(int)) == 1),
        np.flatnonzero(np.diff(still.astype(int)) == -1),
    )
    dwells = [
        slice(start, stop)
        for start, stop in zip(starts, stops, strict=True)
        if time[stop - 1] - time[start] >= LEAST_DWELL
    ]
    return Dwells(
        np.array([time[part.start] for part in dwells]),
        np.array([time[part.stop - 1] for part in dwells]),
        np.array([time[part].mean() for part in dwells]),
        np.array([np.median(path[part], axis=0) for part in dwells]).reshape(-1, 3),
    )


def find_touches(
    recordings: Sequence[TimedRecording], names: Sequence[str], expected: FloatArray
) -> FoundTouches | None:
    """Find the dwells that lie to each other as the landmarks do, touched in the stated order.

    Args:
        recordings: searched one by one; touches lie in one of them.
        names: of the landmarks, in the order of touching.
        expected: (n, 3) tool centres at them [m], phantom frame.

    Returns:
        the best choice of all recordings; None with fewer dwells than landmarks, or fewer than
        four landmarks.
    """
    if len(names) < 4:
        return None
    best: FoundTouches | None = None
    for recording in recordings:
        dwells = find_dwells(recording)
        times, places = dwells.middles, dwells.places
        if len(places) < len(names):
            continue
        choices = np.array(list(islice(combinations(range(len(places)), len(names)), _MOST)))
        _, _, rms = rigid_fits(expected, places[choices])
        order = np.argsort(rms)
        chosen = choices[order[0]]
        other = _second(rms[order], choices[order], places)
        found = FoundTouches(
            tuple(names), places[chosen], times[chosen], float(rms[order[0]]), other
        )
        if best is None or found.rms < best.rms:
            best = found
    return best


def _second(rms: FloatArray, choices: FloatArray, places: FloatArray) -> float:
    """RMS of the best choice of other places than the first one's."""
    first = places[choices[0]]
    for other, choice in zip(rms[1:], choices[1:], strict=True):
        # A landmark that was touched again, or the wait above it, is no other place.
        if np.linalg.norm(places[choice] - first, axis=1).max() > 2 * FARTHEST:
            return float(other)
    return float("inf")
