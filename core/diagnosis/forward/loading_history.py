"""Loading history of the phantom between groups, interpolated from the groups alone.

A push is an interval in which the tool reaches into the stated block. Within a push, any quantity
of a group (a strain, a pressure) is interpolated linearly in time between groups, from zero at the
start of the push to zero at its end, and scaled by the depth of the tool. Holds and turning points
between groups thus have the duration and the depth of the robot's stream.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.replay.replay import Equilibrium
from palpate.setup.setup import Setup

__all__ = ["LoadingHistory", "loading_history_of"]


@dataclass(frozen=True, eq=False)
class LoadingHistory:
    """Loading history of one sequence: t times, g groups, k of them in contact.

    Attributes:
        times: (t,) evenly spaced [s].
        depths: (t,) of the tool in the stated block [m]; zero outside.
        places: (t, 3) of the tool's centre, phantom frame [m].
        instants: (g,) of the groups [s]; NaN for the rest cloud.
        touched: (k,) numbers of the groups in contact.
        shares: (t, k) weights of the groups in contact at every time [1].
    """

    times: FloatArray
    depths: FloatArray
    places: FloatArray
    instants: FloatArray
    touched: tuple[int, ...]
    shares: FloatArray

    def faded(self, rates: FloatArray) -> FloatArray:
        """Weights (g, k) of the groups in contact in an internal variable, at each group.

        The internal variable c relaxes towards the current state: c' = rate (share - c), c(0) = 0.

        Args:
            rates: (t,) [1/s].
        """
        held, weights = (
            np.zeros(len(self.touched)),
            np.zeros((len(self.instants), len(self.touched))),
        )
        steps = np.diff(self.times, append=2 * self.times[-1] - self.times[-2])
        upcoming = np.searchsorted(self.times, self.instants)  # NaN is past the end
        for number, (step, rate) in enumerate(zip(steps, rates, strict=True)):
            weights[upcoming == number] = held
            held = held + (self.shares[number] - held) * -np.expm1(-rate * step)
        weights[(upcoming == len(self.times)) & np.isfinite(self.instants)] = held
        return weights

    def peaks(self) -> list[tuple[float, FloatArray]]:
        """Times [s] of the groups in contact and of each push's deepest instant, in order, with
        their weights (k,).
        """
        instants = [
            (float(self.instants[group]), np.eye(len(self.touched))[number])
            for number, group in enumerate(self.touched)
        ]
        for begin, end in _pushes(self.depths):
            deepest = begin + int(np.argmax(self.depths[begin:end]))
            if self.shares[deepest].any():
                instants.append((float(self.times[deepest]), self.shares[deepest]))
        return sorted(instants, key=lambda one: one[0])


def loading_history_of(
    data: Observations, setup: Setup, moved: Transform, frames: tuple[Equilibrium, ...]
) -> LoadingHistory:
    """Interpolate the loading history of a sequence.

    Args:
        data: the sequence.
        setup: with the robot's registration and clock.
        moved: from stated to true places of the tool.
        frames: equilibria of the groups without history.
    """
    times, path = data.path(setup)
    places = moved.apply(path) + np.array(setup.tool.offset)
    instants = [data.instant(group, setup) for group in data.groups]
    seen = np.array([np.nan if instant is None else instant for instant in instants])
    touched = tuple(
        number
        for number, frame in enumerate(frames)
        if frame.in_contact and np.isfinite(seen[number])
    )
    depths = np.maximum(-setup.geometry.gap(places, setup.tool.radius), 0.0)
    own = np.array([frames[number].tool.centre for number in touched]).reshape(-1, 3)
    reached = np.maximum(-setup.geometry.gap(own, setup.tool.radius), 1e-6)
    shares = np.zeros((len(times), len(touched)))
    for begin, end in _pushes(depths):
        ends = times[begin], times[end - 1]
        inside = [k for k, group in enumerate(touched) if ends[0] <= seen[group] <= ends[1]]
        if not inside:
            continue
        knots = [ends[0], *(float(seen[touched[k]]) for k in inside), ends[1]]
        depth = [0.0, *(float(reached[k]) for k in inside), 0.0]
        for number, ((first, last), (before, after)) in enumerate(
            zip(pairwise(knots), pairwise(depth), strict=True)
        ):
            rows = np.flatnonzero((times[begin:end] >= first) & (times[begin:end] <= last)) + begin
            late = (times[rows] - first) / max(last - first, 1e-9)
            scale = depths[rows] / np.maximum((1 - late) * before + late * after, 1e-6)
            if number:
                shares[rows, inside[number - 1]] = np.minimum(
                    scale * (1 - late), CRITERIA.history.most_interpolated
                )
            if number < len(inside):
                shares[rows, inside[number]] = np.minimum(
                    scale * late, CRITERIA.history.most_interpolated
                )
    return LoadingHistory(times, depths, places, seen, touched, shares)


def _pushes(depths: FloatArray) -> list[tuple[int, int]]:
    """First number of each interval of contact, and the first number after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (depths > 0).astype(int), [0]])))
    return [(int(first), int(last)) for first, last in edges.reshape(-1, 2)]
