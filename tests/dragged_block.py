"""A block along which a ball is dragged, as the diagnosis sees it: nine looks before, in and after
the drag.
"""

from __future__ import annotations

import numpy as np
from pushed_block import GRID, SETUP, TOP, seen_points

from palpate.dataset import Kinematics
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.foundation.arrays import FloatArray
from palpate.replay.replay import replay, rest
from palpate.setup.setup import Setup

LOOKS = (0.1, 0.9, 1.15, 1.35, 1.6, 2.1, 2.7, 3.4, 4.9)
"""When the groups were seen [s]: before, on the way in, four times in the drag and its hold, and
three times after the release."""
FREE = (0, 6, 7, 8)
DURATION, DENSE = 5.0, 0.05


def centres(time: FloatArray, turn: float = 1.0) -> FloatArray:
    """Down by 4 mm within a second, 6 mm aside until 1.6 s, there until 2.2 s, and away; tool
    centres (n, 3) [m].
    """
    depth = np.interp(time, [0.2, 1.0, 2.2, 2.6], [-8e-3, 4e-3, 4e-3, -8e-3])
    aside = turn * np.interp(time, [1.0, 1.6], [-3e-3, 3e-3])
    return np.stack([aside, np.full_like(time, -2e-3 * turn), TOP + 5e-3 - depth], axis=1)


def dragged(
    truth: Setup = SETUP, noise: float = 0.0, name: str = "drag-01", turn: float = 1.0
) -> Observations:
    """What is seen of a block that is like this, with noise [m] along the rays; `turn` of -1 drags
    the other way.
    """
    times = np.unique(np.round(np.concatenate([np.arange(LOOKS[0], LOOKS[-1], DENSE), LOOKS]), 6))
    frames = (
        replay(truth, centres(times, turn), GRID, times=times)
        if truth.has_history
        else replay(truth, centres(times, turn), GRID)
    )
    seen = [frames[int(np.argmin(np.abs(times - look)))] for look in LOOKS]
    stream = np.arange(0, DURATION, 2e-3)
    kinematics = Kinematics(
        stream, centres(stream, turn), np.tile([0.0, 0.0, 0.0, 1.0], (len(stream), 1))
    )
    groups = [Group((), seen_points(rest(truth, GRID), 3000, noise, 1), True, True)]
    groups += [
        Group(
            (number,),
            seen_points(frame, 3000, noise, 2 + number, truth),
            number in FREE,
            push=int(number > 0),
        )
        for number, frame in enumerate(seen)
    ]
    return Observations(name, np.array(LOOKS), kinematics, tuple(groups))
