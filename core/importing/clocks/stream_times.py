"""Times of one stream: header stamps, or receipt without any; what goes back is dropped."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.importing.clocks.track import Stamps, Track
from palpate.importing.import_notes import ImportNotes

__all__ = ["StreamTimes", "stream_times"]

LEAST_STEP = 500
"""Least step between two rows [ns]; a double holds seconds since 1970 to 240 ns."""
FARTHEST_STAMP = 2 * 10**9
"""Deviation of a header stamp from its stream's usual delay beyond which it is no stamp [ns]."""
BURST = 0.1
"""Share of the mean gap; receipts closer together came in a burst [1]."""
_UNUSED = 0.5
"""Share of zero stamps above which a stream counts as without any [1]."""


@dataclass(frozen=True, eq=False)
class StreamTimes:
    """Times of the kept samples of a stream.

    Attributes:
        rows: (m,) indices of the kept samples, whose times increase.
        times: (m,) their times [ns].
        by_header: whether these are header stamps.
        uncertainty: of a time, where it is known to be doubtful [s].
    """

    rows: Stamps
    times: Stamps
    by_header: bool
    uncertainty: float = 0.0

    def moved(self, times: Stamps, uncertainty: float) -> StreamTimes:
        """The same samples at other times [ns]."""
        return StreamTimes(self.rows, times, self.by_header, max(uncertainty, self.uncertainty))


def stream_times(track: Track, notes: ImportNotes, use_receipt: bool = False) -> StreamTimes:
    """Choose the stamps of a stream and drop samples whose time does not increase.

    Args:
        track: of the stream.
        notes: take what was done.
        use_receipt: times of receipt although there are header stamps.
    """
    if not track.has_receipt:
        rows = np.argsort(track.received, kind="stable")
        return _increasing(track, rows, track.received[rows], False, 0.0, notes)
    zero = track.stamped == 0
    by_header = not use_receipt and float(zero.mean()) <= _UNUSED
    if by_header:
        rows = np.flatnonzero(~zero)
        _count(notes, track, int(zero.sum()), "have a header stamp of zero: dropped")
        rows = rows[_plausible(track, rows, notes)]
        return _increasing(track, rows, track.stamped[rows], True, 0.0, notes)
    rows = np.argsort(track.received, kind="stable")
    if not use_receipt:
        notes.warn(
            f"{track.stream}: has no header stamps; its times are those of receipt, later than the "
            "measurement by an unknown delay"
        )
    times, uncertainty = _spread_bursts(track, track.received[rows], notes)
    return _increasing(track, rows, times, False, uncertainty, notes)


def _plausible(track: Track, rows: Stamps, notes: ImportNotes) -> Stamps:
    """Indices into `rows` of stamps that keep near the stream's usual delay."""
    if len(rows) < 3:
        return np.arange(len(rows))
    delay = track.received[rows] - track.stamped[rows]
    # A drift of 1 % over ten minutes is no stray stamp: deviations from a slow course count.
    course = _running_median(delay)
    near = np.abs(delay - course) <= FARTHEST_STAMP
    _count(notes, track, int((~near).sum()), "have a stray header stamp: dropped")
    return np.flatnonzero(near)


def _running_median(values: Stamps) -> Stamps:
    """Medians of blocks of 101 samples, interpolated."""
    blocks = np.array_split(np.arange(len(values)), max(1, len(values) // 101))
    centres = [float(block.mean()) for block in blocks]
    # Differences of stamps stay exact in a double up to 2**53 ns, 104 days; beyond, to 256 ns.
    medians = [float(np.median(values[block])) for block in blocks]
    return np.interp(np.arange(len(values)), centres, medians).astype(np.int64)


def _increasing(
    track: Track,
    rows: Stamps,
    times: Stamps,
    by_header: bool,
    uncertainty: float,
    notes: ImportNotes,
) -> StreamTimes:
    if not len(times):
        return StreamTimes(rows, times, by_header, uncertainty)
    before = np.maximum.accumulate(times)
    kept = np.concatenate([[True], times[1:] > before[:-1] + LEAST_STEP])
    dropped = int((~kept).sum())
    back = int((before - times).max()) / 1e3
    how = f"up to {back:.2f} us back" if back else "repeats"
    _count(notes, track, dropped, f"do not come later than the one before ({how}): dropped")
    if dropped > 0.1 * len(times):
        notes.warn(
            f"{track.stream}: {dropped} of {len(times)} stamps do not increase; expected a few at "
            "most: look at how it was recorded"
        )
    return StreamTimes(rows[kept], times[kept], by_header, uncertainty)


def _spread_bursts(track: Track, times: Stamps, notes: ImportNotes) -> tuple[Stamps, float]:
    """Even times where receipts come in bursts, with the largest deviation from them [s]."""
    if len(times) < 10:
        return times, 0.0
    gaps = np.diff(times)
    if np.median(gaps) >= BURST * gaps.mean():
        return times, 0.0
    start, number = int(times[0]), np.arange(len(times))
    step, first = np.polyfit(number, (times - start).astype(float), 1)
    even = first + step * number
    # The last of a burst is the nearest to its receipt: nothing comes before it was measured.
    even += min(0.0, float((times - start - even).min()))
    uncertainty = float(np.abs(times - start - even).max()) / 1e9
    notes.warn(
        f"{track.stream}: receipts come in bursts (median gap {np.median(gaps) / 1e3:.0f} us, "
        f"mean {gaps.mean() / 1e6:.1f} ms) and there are no header stamps; its times were "
        f"spread evenly, uncertain by {1e3 * uncertainty:.0f} ms"
    )
    return start + even.astype(np.int64), uncertainty


def _count(notes: ImportNotes, track: Track, count: int, text: str) -> None:
    if count:
        notes.decide(f"{track.stream}: {count} of {len(track)} samples {text}")
