"""Key frames of one planned push: where the equilibrium is solved along the tool's path."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.motion_plan import PlannedPush
from palpate.synthetic.bench.solved_track import PathSegment
from palpate.synthetic.bench.specimen import Specimen

__all__ = ["solve_segments"]

KEY_SPACING, SLIDING_SPACING, DRAGGED_SPACING = 1.0e-3, 1.3e-3, 0.8e-3
"""Distance between two key frames [m]: of a tool that presses, one that slides along the surface,
and one that drags the surface along by friction."""
_FIRST_WAIT, _LONGER = (0.1, 0.25), 1.6
"""First time step of a hold: at least this [s], and this share of the time constant [1]. Each
further step is longer by the factor _LONGER."""


def solve_segments(specimen: Specimen, push: PlannedPush, until: float) -> tuple[PathSegment, ...]:
    """Solve all segments of one push in order of time.

    A block that changes while the tool is away gets one more segment `until` the next push [s].
    """
    segments: list[PathSegment] = []
    for number, (first, last) in enumerate(pairwise(push.arcs)):
        if first == last:
            if specimen.changes_at_rest:
                segments.append(
                    _hold_segment(specimen, push, number, float(push.times[number + 1]))
                )
            continue
        low, high = float(min(first, last)), float(max(first, last))
        known = next(
            (
                one
                for one in segments
                if not specimen.path_dependent and (one.arcs[0], one.arcs[-1]) == (low, high)
            ),
            None,
        )
        if known is None:
            arcs = _key_arcs(specimen, push, low, high)
            ordered = arcs if first < last else arcs[::-1]
            times = push.when(number, ordered)
            key_frames = [
                specimen.solve_key_frame(place + specimen.offset(place), float(time))
                for place, time in zip(push.place(ordered), times, strict=True)
            ]
            key_frames = key_frames if first < last else key_frames[::-1]
        else:
            arcs, key_frames = known.arcs, list(known.key_frames)
        segments.append(
            PathSegment(
                float(push.times[number]), float(push.times[number + 1]), arcs, tuple(key_frames)
            )
        )
    if specimen.changes_at_rest:
        segments.append(_hold_segment(specimen, push, len(push.times) - 1, until))
    return tuple(segments)


def _hold_segment(specimen: Specimen, push: PlannedPush, number: int, until: float) -> PathSegment:
    """Solve a hold at a knot of the push; the time between key frames grows with the hold."""
    stated = push.place(push.arcs[number : number + 1])[0]
    centre, times = stated + specimen.offset(stated), [float(push.times[number])]
    step = (
        _FIRST_WAIT[1]
        if specimen.memory is None
        else max(_FIRST_WAIT[0], _FIRST_WAIT[1] * specimen.memory.time_constant)
    )
    while times[-1] + 1.3 * step < until:
        times.append(times[-1] + step)
        step *= _LONGER
    times.append(until)
    key_frames = tuple(specimen.solve_key_frame(centre, time) for time in times)
    return PathSegment(times[0], until, np.array(times), key_frames, timed=True)


def _key_arcs(specimen: Specimen, push: PlannedPush, low: float, high: float) -> FloatArray:
    """Choose arc lengths (n,) [m] of key frames: even ones in contact, one just after its begin."""
    fine = np.linspace(low, high, 2 + int((high - low) / 5e-5))
    stated = push.place(fine)
    touching = np.nonzero(
        specimen.clearance.gap(stated + specimen.offset(stated) - specimen.slip) < 0
    )[0]
    if not len(touching):
        return np.linspace(low, high, 5) if specimen.changes_at_rest else np.array([low, high])
    begin, end = fine[max(touching[0] - 1, 0)], fine[min(touching[-1] + 1, len(fine) - 1)]
    sliding = begin == low and end == high
    spacing = SLIDING_SPACING if sliding else KEY_SPACING
    spacing = DRAGGED_SPACING if specimen.drag is not None else spacing
    keys = [np.array([low, high]), np.linspace(begin, end, 2 + int((end - begin) / spacing))]
    keys += [begin + np.array([0.3e-3])] if begin > low else []
    keys += [end - np.array([0.3e-3])] if end < high else []
    keys += [np.linspace(low, begin, 4)] if specimen.changes_at_rest else []
    return np.unique(np.clip(np.concatenate(keys), low, high))
