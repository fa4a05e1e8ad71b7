"""Streams of a recording as rows of a table: rate, delay, role, gaps, and faults by time."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from palpate.consistency.stream_faults import frozen_stretch, longest_jump
from palpate.dataset import Kinematics
from palpate.first_look.series import as_list
from palpate.foundation.progress import Report
from palpate.importing.clocks.common_clock import on_common_clock
from palpate.importing.clocks.stream_times import StreamTimes, stream_times
from palpate.importing.clocks.track import Stamps, Track
from palpate.importing.import_notes import ImportNotes
from palpate.importing.recording import Recording
from palpate.importing.rules import ImportMapping
from palpate.importing.stream import Stream

__all__ = ["read_tracks", "stream_rows", "times_of"]

GAP_PERIODS, LEAST_GAP, MOST_GAPS = 3.0, 0.1, 200
"""Periods and time [s] from which a pause is a gap, and number of gaps that are told."""
_MOST_FAULTS = 200
_NUMERIC = ("pose", "wrench")


def read_tracks(recording: Recording, report: Report) -> dict[str, Track]:
    """Read the stamps of all streams of a known kind in one pass, and the values of poses and
    forces; no cloud is decoded.
    """
    names = {one.name: one.kind in _NUMERIC for one in recording.streams() if one.kind != "other"}
    return recording.tracks(names, report)


def times_of(tracks: dict[str, Track], mapping: ImportMapping) -> dict[str, StreamTimes]:
    """Times of all streams on the clock of the tool's poses; without them on that of the stream
    with most samples.
    """
    quiet = ImportNotes()
    by_receipt = mapping.time.stamps == "receipt"
    times = {name: stream_times(track, quiet, by_receipt) for name, track in tracks.items()}
    if not times:
        return {}
    pose = mapping.streams.pose
    reference = pose if pose in times else max(times, key=lambda name: len(times[name].rows))
    return on_common_clock(tracks, times, reference, quiet)


def stream_rows(
    recording: Recording,
    tracks: dict[str, Track],
    times: dict[str, StreamTimes],
    mapping: ImportMapping,
) -> list[dict[str, Any]]:
    """One row for each stream, as in look.json."""
    roles = {name: role for role, name in mapping.streams.model_dump().items() if name}
    return [
        {
            "name": one.name,
            "kind": one.kind,
            "type": one.message_type,
            "samples": len(tracks[one.name]) if one.name in tracks else one.count,
            "rate": round(one.rate, 3) if one.rate < 1e6 else 0.0,
            "delay": None if one.delay is None else round(one.delay, 6),
            "frame": ", ".join(one.frames),
            "role": roles.get(one.name),
            "gaps": _gaps(times[one.name].times) if one.name in times else [],
            "faults": list(_faults(one, tracks[one.name], times[one.name]))[:_MOST_FAULTS]
            if one.name in times
            else [],
        }
        for one in recording.streams()
    ]


def _gaps(times: Stamps) -> list[list[float]]:
    """Start and end [s] of pauses, the longest ones, in order of time."""
    if len(times) < 3:
        return []
    steps = np.diff(times) / 1e9
    found = np.flatnonzero(steps > max(GAP_PERIODS * float(np.median(steps)), LEAST_GAP))
    longest = np.sort(found[np.argsort(-steps[found], kind="stable")][:MOST_GAPS])
    return [as_list(np.array([times[at], times[at + 1]]) / 1e9) for at in longest]


def _faults(stream: Stream, track: Track, own: StreamTimes) -> Iterator[dict[str, Any]]:
    """Faults in order of their kinds: dropped stamps, a jump, a stretch of standing still."""
    kept = own.rows
    if not len(kept):
        yield {"t": 0.0, "text": f"none of {len(track)} samples has a usable stamp"}
        return
    yield from _dropped(track, own)
    if stream.kind != "pose" or len(kept) < 3 or not len(track.values):
        return
    values = track.values[kept]
    good = np.isfinite(values).all(axis=1)
    path = Kinematics(own.times[good] / 1e9, values[good, :3], values[good, 3:])
    if len(path.time) < 3:
        return
    if jump := longest_jump(path):
        row, step, speed, count = jump
        text = f"jumps away and back by {1e3 * step:.0f} mm at {speed:.3g} m/s, {count} samples"
        yield {"t": round(float(path.time[row]), 6), "text": text}
    if still := frozen_stretch(path):
        text = f"repeats one pose exactly for {still[1]:.2f} s"
        yield {"t": round(still[0], 6), "text": text}


def _dropped(track: Track, own: StreamTimes) -> Iterator[dict[str, Any]]:
    """Runs of samples whose stamps are not used, at the time of the kept sample before."""
    # Receipt is sorted before it is used, so that rows tell an order in the file only by header.
    lost = np.setdiff1d(np.arange(len(track)), own.rows)
    if not len(lost):
        return
    order = np.sort(own.rows)
    time_at = dict(zip(own.rows.tolist(), own.times.tolist(), strict=True))
    for run in np.split(lost, np.flatnonzero(np.diff(lost) > 1) + 1):
        before = int(np.searchsorted(order, run[0])) - 1
        at = time_at[int(order[max(before, 0)])]
        how = "zero" if not track.stamped[run].any() and own.by_header else "not later, or far off"
        many = "one stamp is" if len(run) == 1 else f"{len(run)} stamps are"
        yield {"t": round(at / 1e9, 6), "text": f"{many} {how}: dropped"}
