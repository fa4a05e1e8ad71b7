"""Choice of the frames that a sweep compares: those that tell the most about the model."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray

__all__ = ["informative_frames"]

_SAME_PLACE = 5e-3
"""Distance between two tool centres from which they press on other tissue [m]."""


def informative_frames(
    centres: FloatArray, depth: FloatArray, touched: BoolArray, count: int
) -> IntArray:
    """Choose frames in which the tool presses deep, at places and depths that differ.

    The deepest frame comes first. Each further one has the largest product of its depth and its
    distance from the frames that were chosen before, in place and depth.

    Args:
        centres: (f, 3) of the tool [m], phantom frame.
        depth: (f,) of the tool in the surface at rest [m].
        touched: (f,) frames that may be chosen, at least one.
        count: most frames.

    Returns:
        indices (c,) of the frames, increasing; c is at most `count`.
    """
    near = np.flatnonzero(touched)
    if len(near) <= count:
        return near
    # A frame that hardly touches says little, but more than nothing.
    least = max(float(depth[near].max()), 1e-6) / 50
    worth = np.maximum(depth[near], least)
    places = np.column_stack([centres[near], depth[near]])
    chosen = [int(worth.argmax())]
    apart = np.linalg.norm(places - places[chosen[0]], axis=1)
    while len(chosen) < count:
        gain = worth * np.minimum(apart, _SAME_PLACE)
        gain[chosen] = -1.0
        chosen.append(int(gain.argmax()))
        apart = np.minimum(apart, np.linalg.norm(places - places[chosen[-1]], axis=1))
    return np.asarray(near[np.sort(chosen)])
