"""Falsified recordings: the measured clouds with motions that were not made.

A cause whose gain remains under them does not owe it to the pushes. The clock is shifted until the
pushes come when nothing was pushed, the tool is mirrored to the other end of the block, or the tool
follows the path of another sequence. Points, patches and their order stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from palpate.dataset import Kinematics
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Setup

__all__ = ["FALSIFIED", "mirrored", "shifted", "swapped"]

MIRROR = np.array([-1.0, -1.0, 1.0])
"""Factors that exchange both ends and both sides of the block. Exchanging only one pair would map a
push near a middle plane onto itself."""


def _with_path(item: Observations, position: FloatArray) -> Observations:
    """Replace the tool's path by another one (n, 3) [m], robot frame, at the stream's own times.

    A group's frames no longer share one place, so that its middle frame stands for it.
    """
    stream = item.kinematics
    groups = tuple(replace(g, frames=g.frames[len(g.frames) // 2 :][:1]) for g in item.groups)
    return replace(
        item, kinematics=Kinematics(stream.time, position, stream.quaternion), groups=groups
    )


def _turned(item: Observations, share: float) -> Observations:
    """Shift the clock by a share of the recording, cyclically."""
    time = item.kinematics.time
    length = time[-1] - time[0]
    return _with_path(
        item, item.kinematics.position_at(time[0] + (time - time[0] + share * length) % length)
    )


def _depths(item: Observations, setup: Setup) -> FloatArray:
    """Depth of the tool in the stated block (g,) [m] at each group; zero outside."""
    return np.maximum(-setup.geometry.gap(item.centres(setup), setup.tool.radius), 0.0)


def shifted(data: Sequence[Observations], setup: Setup) -> list[Observations]:
    """Shift each clock, cyclically, to where its pushes agree least with those that were made."""
    recordings = []
    for item in data:
        true, best = _depths(item, setup), (np.inf, item)
        for share in CRITERIA.controls.clock_shifts:
            other = _turned(item, float(share))
            depths = _depths(other, setup)
            shallow = depths.max() < CRITERIA.controls.least_depth_share * true.max()
            agreement = (
                float(depths @ true)
                / max(float(np.linalg.norm(depths) * np.linalg.norm(true)), 1e-12)
                + 10.0 * shallow
            )
            if agreement < best[0]:
                best = (agreement, other)
        recordings.append(best[1])
    return recordings


def mirrored(data: Sequence[Observations], setup: Setup) -> list[Observations]:
    """Mirror each tool's path: x and y change sign in the phantom frame."""
    pose = setup.phantom_from_robot
    return [
        _with_path(item, pose.inverse().apply(pose.apply(item.kinematics.position) * MIRROR))
        for item in data
    ]


def swapped(data: Sequence[Observations], setup: Setup) -> list[Observations]:
    """Give each tool the path of another sequence, stretched to its own duration.

    Of all cyclic exchanges the one is taken that brings the deepest places farthest apart.
    """
    deepest = np.array([item.centres(setup)[_depths(item, setup).argmax()] for item in data])

    def apart(turn: int) -> float:
        return float(np.linalg.norm(deepest - np.roll(deepest, -turn, axis=0), axis=1).min())

    turn = max(range(1, len(data)), key=apart, default=0)
    return [
        _along(item, other) for item, other in zip(data, [*data[turn:], *data[:turn]], strict=True)
    ]


def _along(item: Observations, other: Observations) -> Observations:
    """Replace the tool's path by that of another sequence, stretched in time."""
    here, there = item.kinematics.time, other.kinematics.time
    share = (here - here[0]) / max(here[-1] - here[0], 1e-9)
    return _with_path(item, other.kinematics.position_at(there[0] + share * (there[-1] - there[0])))


Falsify = Callable[[Sequence[Observations], Setup], list[Observations]]
FALSIFIED: Mapping[str, Falsify] = {
    "clock shifted": shifted,
    "geometry mirrored": mirrored,
    "paths swapped": swapped,
}
