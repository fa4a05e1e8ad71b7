"""Relation of the clocks of several streams: other epochs, and drift of one against another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.importing.clocks.stream_times import StreamTimes
from palpate.importing.clocks.track import Stamps, Track
from palpate.importing.import_notes import ImportNotes

__all__ = ["ClockDelay", "on_common_clock"]

OTHER_EPOCH = 1.0
"""Difference of two streams' delays between stamp and receipt that no delivery takes [s]."""
LEAST_DRIFT = 0.002
"""Drift over a recording that is worth a correction [s]; a push of 20 mm/s moves 0.04 mm then."""
CLEAR_DRIFT = 4.0
"""Ratio of a drift to the scatter around it from which it is unambiguous [1]."""
_BINS = 24


@dataclass(frozen=True, eq=False)
class ClockDelay:
    """Delay between the stamps of a stream and their receipt.

    The least delay in each part of the recording is that of a message delivered at once.

    Attributes:
        usual: least delay in the middle [s].
        slope: of the least delay over time [1], the drift of the stamps' clock.
        scatter: standard deviation of the least delays around that line [s].
        spread: delivery takes up to this beyond the least delay, 95 % of the time [s].
        seconds: length of the recording [s].
    """

    usual: float
    slope: float
    scatter: float
    spread: float
    seconds: float

    @property
    def drift(self) -> float:
        """Change of the delay over the recording [s]."""
        return self.slope * self.seconds

    @classmethod
    def of(cls, received: Stamps, stamped: Stamps) -> ClockDelay:
        """Fit the delay of a stream's kept samples [ns]."""
        origin = int(received[0] - stamped[0])
        delay = (received - stamped - origin) / 1e9
        time = (received - received[0]) / 1e9
        seconds = float(time[-1])
        bins = min(_BINS, max(1, len(time) // 10))
        parts = np.array_split(np.arange(len(time)), bins)
        at = np.array([time[part[np.argmin(delay[part])]] for part in parts])
        least = np.array([delay[part].min() for part in parts])
        slope, middle = np.polyfit(at, least, 1) if len(at) >= 4 else (0.0, float(least.min()))
        scatter = float(np.std(least - middle - slope * at)) if len(at) >= 4 else 0.0
        spread = float(np.quantile(delay - middle - slope * time, 0.95))
        usual = origin / 1e9 + float(middle) + float(slope) * seconds / 2
        return cls(usual, float(slope), scatter, max(0.0, spread), seconds)


def on_common_clock(
    tracks: dict[str, Track], times: dict[str, StreamTimes], reference: str, notes: ImportNotes
) -> dict[str, StreamTimes]:
    """Bring the times of all streams to the clock of the reference stream.

    Streams whose stamps have another epoch are moved by the difference of least delays; a clear
    drift against the reference is removed. Each is told with its bound.

    Args:
        tracks: by role.
        times: of the same roles.
        reference: role whose clock is kept.
        notes: take what was done.
    """
    delays = {
        role: ClockDelay.of(track.received[own.rows], track.stamped[own.rows])
        for role, track in tracks.items()
        if (own := times[role]).by_header and track.has_receipt and len(own.rows) > 2
    }
    base = delays.get(reference)
    moved = dict(times)
    for role, own in times.items():
        if role == reference or not len(own.rows):
            continue
        if role in delays and base is not None:
            moved[role] = _related(tracks[role], own, delays[role], base, notes)
        elif base is not None and not own.by_header and tracks[role].has_receipt:
            moved[role] = _by_receipt(tracks[role], own, base, notes)
        elif role in delays and tracks[reference].has_receipt and not times[reference].by_header:
            moved[role] = _to_receipt(tracks[role], own, delays[role], notes)
    return moved


def _related(
    track: Track, own: StreamTimes, delay: ClockDelay, base: ClockDelay, notes: ImportNotes
) -> StreamTimes:
    """Times of a header stream on the clock of the reference's header stamps."""
    shift, bound, slope = 0.0, 0.0, 0.0
    apart = delay.usual - base.usual
    if abs(apart) > OTHER_EPOCH:
        shift, bound = apart, delay.spread + base.spread
        notes.warn(
            f"{track.stream}: its clock is {apart:.3f} s behind that of the poses; moved by the "
            f"least delays of delivery, uncertain by {1e3 * bound:.0f} ms"
        )
    drift = (delay.slope - base.slope) * delay.seconds
    scatter = float(np.hypot(delay.scatter, base.scatter))
    if abs(drift) > LEAST_DRIFT:
        text = f"{track.stream}: its clock drifts by {1e3 * drift:.1f} ms in {delay.seconds:.0f} s"
        if abs(drift) > CLEAR_DRIFT * scatter:
            slope, bound = delay.slope - base.slope, max(bound, 2 * scatter)
            notes.warn(f"{text} against the poses; removed, to {1e3 * scatter:.1f} ms")
        elif abs(drift) > 2 * scatter:
            bound = max(bound, abs(drift) / 2)
            notes.warn(
                f"{text} against the poses, but the delays scatter by {1e3 * scatter:.1f} ms; left "
                "as it is"
            )
    if not shift and not slope:
        return own
    return own.moved(_shifted(own.times, shift, slope, delay.seconds), bound)


def _by_receipt(
    track: Track, own: StreamTimes, base: ClockDelay, notes: ImportNotes
) -> StreamTimes:
    """Times of receipt on the clock of the reference's header stamps."""
    if abs(base.usual) <= OTHER_EPOCH:
        return own.moved(own.times, base.spread)
    notes.warn(
        f"{track.stream}: only its receipt is known, {base.usual:.3f} s from the header stamps of "
        f"the poses; moved by that, uncertain by {1e3 * base.spread:.0f} ms or more"
    )
    return own.moved(_shifted(own.times, -base.usual, 0.0, base.seconds), base.spread)


def _to_receipt(
    track: Track, own: StreamTimes, delay: ClockDelay, notes: ImportNotes
) -> StreamTimes:
    """Header stamps on the clock of receipt, which is all that the reference has."""
    if abs(delay.usual) <= OTHER_EPOCH:
        return own
    notes.warn(
        f"{track.stream}: its header stamps are {delay.usual:.3f} s from their receipt, by which "
        f"the poses are timed; moved by that, uncertain by {1e3 * delay.spread:.0f} ms"
    )
    moved = _shifted(own.times, delay.usual, delay.slope, delay.seconds)
    return own.moved(moved, delay.spread)


def _shifted(times: Stamps, shift: float, slope: float, seconds: float) -> Stamps:
    """Times plus `shift` [s] in the middle, changing by `slope` [1]."""
    elapsed: FloatArray = (times - times[0]) / 1e9 - seconds / 2
    return times + round(shift * 1e9) + np.round(slope * elapsed * 1e9).astype(np.int64)
