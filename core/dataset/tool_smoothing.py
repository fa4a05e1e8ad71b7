"""Moving averages of streams, for the tool's position and force."""

from __future__ import annotations

import numpy as np

from palpate.dataset import Kinematics
from palpate.foundation.arrays import FloatArray

__all__ = ["SMOOTHING", "averaged", "smooth_centres"]

SMOOTHING = 0.02
"""Half the window of the average [s]; positions have noise of some hundredths of a millimetre."""


def averaged(time: FloatArray, values: FloatArray, times: FloatArray) -> FloatArray:
    """Means (m, d) of values (n, d) over windows of SMOOTHING to both sides of `times`.

    Args:
        time: (n,) stamps [s]; values are linear in between.
        values: (n, d).
        times: (m,) middles of the windows [s].
    """
    if len(time) < 2:
        return np.tile(values, (len(times), 1))
    integral = np.concatenate(
        [
            np.zeros((1, values.shape[1])),
            np.cumsum((values[1:] + values[:-1]) / 2 * np.diff(time)[:, None], axis=0),
        ]
    )

    def until(at: FloatArray) -> FloatArray:
        # Exact within a step: of a slow stream the window is a small part of one.
        row = np.clip(np.searchsorted(time, at, side="right") - 1, 0, len(time) - 2)
        into, step = (at - time[row])[:, None], (time[row + 1] - time[row])[:, None]
        slope = (values[row + 1] - values[row]) / step
        return np.asarray(integral[row] + into * (values[row] + slope * into / 2))

    low, high = (
        np.clip(times - SMOOTHING, time[0], time[-1]),
        np.clip(times + SMOOTHING, time[0], time[-1]),
    )
    width = (high - low)[..., None]
    mean = (until(high) - until(low)) / np.maximum(width, 1e-9)
    nearest = np.stack(
        [np.interp(times, time, values[:, axis]) for axis in range(values.shape[1])], axis=-1
    )
    return np.where(width > 1e-6, mean, nearest)


def smooth_centres(kinematics: Kinematics, times: FloatArray) -> FloatArray:
    """Tool centres (m, 3) [m], robot frame, averaged about `times` (m,) [s]."""
    return averaged(kinematics.time, kinematics.position, times)
