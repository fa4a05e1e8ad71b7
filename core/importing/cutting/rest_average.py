"""The rest cloud: an average of frames in which the tool is clear of the phantom."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.dataset.tool_motion import averaged_path
from palpate.foundation.arrays import FloatArray
from palpate.importing.clocks.track import Stamps
from palpate.importing.cutting.pushes import LocatedPhantom
from palpate.importing.timed_recording import TimedRecording

__all__ = ["averaged_cloud", "untouched_clouds"]

CLEAR = 0.01
"""Gap from which the tool is clear of the phantom and of its shadow on it [m]."""
FIRST = 1.0
"""Time at the start of a recording that counts as untouched where no phantom is known [s]."""
_ROWS = 32
"""Rows of an image that are averaged at a time, which bounds the memory."""
_LEAST_SHARE = 0.5
"""Share of frames in which a pixel must be seen to count."""


def untouched_clouds(
    recording: TimedRecording, phantom: LocatedPhantom | None, most: int
) -> tuple[Stamps, str]:
    """Choose clouds before the first contact in which the tool is farthest from the phantom.

    Returns:
        indices into `cloud_times`, in order of time, at most `most`; and how they were chosen.
    """
    times = recording.cloud_times / 1e9
    if phantom is None:
        early = np.flatnonzero(times <= times[0] + FIRST)[:most]
        return early, f"the first {FIRST:g} s, as no phantom is stated to be clear of"
    contacts, gap = phantom.contacts(recording)
    steady, _ = averaged_path(recording.time, phantom.in_phantom(recording))
    gaps = np.interp(times, steady, gap)
    first = contacts[0].start if contacts else np.inf
    before = np.flatnonzero((times < first) & (gaps > CLEAR))
    if not len(before):
        before = np.flatnonzero(times < first)
    if not len(before):
        return before, "none: the recording begins in contact"
    chosen = np.sort(before[np.argsort(-gaps[before], kind="stable")][:most])
    return chosen, f"the tool {1e3 * gaps[chosen].min():.0f} mm or more away, before any contact"


def _medians(frames: Sequence[FloatArray]) -> FloatArray:
    """Medians (m, 3) [m] of the pixels of frames (rows, columns, 3) that are often seen."""
    stack = np.stack(frames)
    seen = np.isfinite(stack).all(axis=-1)
    often = seen.mean(axis=0) >= _LEAST_SHARE
    # The median keeps a flying pixel out of the mean of its place.
    return np.asarray(np.nanmedian(stack[:, often], axis=0))


def averaged_cloud(frames: Sequence[FloatArray]) -> tuple[FloatArray, str]:
    """Average frames pixel by pixel where they are organised, else take the middle one.

    Args:
        frames: each (rows, columns, 3), or (n, 3) [m]; NaN without a measurement.

    Returns:
        points (m, 3) [m], and how they were made.
    """
    shapes = {frame.shape for frame in frames}
    if len(frames) > 1 and len(shapes) == 1 and frames[0].ndim == 3:
        points = np.concatenate(
            [
                _medians([frame[start : start + _ROWS] for frame in frames])
                for start in range(0, len(frames[0]), _ROWS)
            ]
        )
        return points, f"median of {len(frames)} frames, pixel by pixel"
    middle = frames[len(frames) // 2].reshape(-1, 3)
    why = "its clouds are not organised" if len(frames) > 1 else "there is one"
    return middle[np.isfinite(middle).all(axis=1)], f"one frame of {len(frames)}, as {why}"
