"""Jumps of a clock within a recording: its stamps before and after differ by a step."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.importing.clocks.track import Stamps, Track
from palpate.importing.import_notes import ImportNotes

__all__ = ["ClockJump", "find_jumps", "without_jumps"]

LEAST_JUMP = 0.02
"""Smallest step of a clock that is looked for [s]; deliveries scatter by some milliseconds."""
CLEAR_JUMP = 8.0
"""Ratio of a step to the scatter of the delays from which it is unambiguous [1]."""
TOGETHER = 1.0
"""Streams whose delays change within this time have not changed on their own [s]."""
_BLOCK = 25
_LASTING = 4
"""Blocks on each side over which the delay has to keep its level."""
_FEWEST = 2 * _LASTING + 2


@dataclass(frozen=True)
class ClockJump:
    """A step of the delay between stamps and receipt.

    Attributes:
        row: first sample after it, among all of the stream.
        time: of its receipt [ns].
        step: by which the delay grows; the stamps fall back by it [s].
        scatter: standard deviation of the delay's medians over a second or so [s].
    """

    row: int
    time: int
    step: float
    scatter: float


def find_jumps(track: Track) -> list[ClockJump]:
    """Find the steps between two levels of a stream's delay, each of which lasts.

    A delay that rises for a moment, as while a network stalls, is none. Without times of receipt,
    or with too few samples, there are none.
    """
    rows = np.flatnonzero(track.stamped != 0)
    if not track.has_receipt or len(rows) < _FEWEST * _BLOCK:
        return []
    delay = (track.received[rows] - track.stamped[rows]) / 1e9
    delay = delay - np.median(delay)
    blocks = np.array_split(np.arange(len(rows)), len(rows) // _BLOCK)
    levels = np.array([np.median(delay[block]) for block in blocks])
    steps = levels[2:] - levels[:-2]
    # A drift changes each step alike.
    usual = float(np.median(steps))
    scatter = float(1.48 * np.median(np.abs(steps - usual)))
    bound = max(LEAST_JUMP, CLEAR_JUMP * scatter)
    found: list[ClockJump] = []
    for at in _peaks(np.abs(steps - usual), bound):
        step = _lasting_step(levels, at + 1, usual / 2, bound)
        if step is not None:
            within = np.concatenate(blocks[at : at + 3])
            row = int(rows[within[0] + _split(delay[within])])
            found.append(ClockJump(row, int(track.received[row]), step, scatter))
    return found


def without_jumps(tracks: Mapping[str, Track], notes: ImportNotes) -> dict[str, Track]:
    """Move the stamps that follow a jump of their own clock back to those before.

    Where all streams jump together, the clock of the receipt was set: their stamps stay. Both are
    told.

    Args:
        tracks: by role.
        notes: take what was done.
    """
    jumps = {role: find_jumps(track) for role, track in tracks.items()}
    judged = {role for role, track in tracks.items() if track.has_receipt and track.stamped.any()}
    moved = dict(tracks)
    for role, found in jumps.items():
        for jump in found:
            track = moved[role]
            said = (
                f"{track.stream}: the delay of its stamps jumps by {jump.step:.3f} s at its "
                f"sample {jump.row + 1}"
            )
            others = judged - {role}
            if others and all(_has(jumps[other], jump) for other in others):
                notes.warn(f"{said}, as that of all streams: the recorder's clock was set; kept")
                continue
            notes.warn(
                f"{said}, as no other stream's: its clock was set; later stamps are moved by "
                f"that, uncertain by {1e3 * jump.scatter:.1f} ms"
            )
            moved[role] = _moved(track, jump)
    return moved


def _peaks(sizes: FloatArray, bound: float) -> list[int]:
    """Indices of the largest of each group of neighbours beyond the bound."""
    found: list[int] = []
    for at in np.argsort(-sizes, kind="stable").tolist():
        if sizes[at] <= bound:
            break
        if all(abs(at - other) > 2 for other in found):
            found.append(at)
    return sorted(found)


def _lasting_step(levels: FloatArray, middle: int, slope: float, bound: float) -> float | None:
    """Difference of the levels [s] around a block, without the drift; None where one changes."""
    before, after = levels[max(0, middle - _LASTING) : middle], levels[middle + 1 :][:_LASTING]
    if min(len(before), len(after)) < 2:
        return None
    straight = [
        side - slope * (np.arange(len(side)) - (len(side) - 1) / 2) for side in (before, after)
    ]
    if max(float(np.ptp(side)) for side in straight) > bound:
        return None
    apart = (len(before) + len(after)) / 2 + 1
    step = float(np.median(straight[1]) - np.median(straight[0]) - slope * apart)
    return step if abs(step) > bound else None


def _split(delay: FloatArray) -> int:
    """Number of samples before the step, which two levels explain best."""
    before, after = np.median(delay[:_BLOCK]), np.median(delay[-_BLOCK:])
    low, high = np.abs(delay - before), np.abs(delay - after)
    costs = np.concatenate([[0.0], np.cumsum(low)]) + np.concatenate(
        [np.cumsum(high[::-1])[::-1], [0.0]]
    )
    return min(int(np.argmin(costs)), len(delay) - 1)


def _has(jumps: list[ClockJump], one: ClockJump) -> bool:
    near = TOGETHER * 1e9
    return any(
        abs(other.time - one.time) < near and abs(other.step - one.step) < LEAST_JUMP
        for other in jumps
    )


def _moved(track: Track, jump: ClockJump) -> Track:
    stamped: Stamps = track.stamped.copy()
    later = (np.arange(len(stamped)) >= jump.row) & (stamped != 0)
    stamped[later] += round(jump.step * 1e9)
    return replace(track, stamped=stamped)
