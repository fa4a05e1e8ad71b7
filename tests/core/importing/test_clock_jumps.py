"""A clock that was set while a recording ran: its own stamps are moved, those of others stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.importing.clocks.clock_jumps import find_jumps, without_jumps
from palpate.importing.clocks.track import Track
from palpate.importing.import_notes import ImportNotes

START = 1_700_000_000 * 10**9


def track(name: str, rate: float, seed: int, seconds: float = 60.0) -> Track:
    """A stream whose messages take 3 ms and an exponential delay of 4 ms."""
    rng = np.random.default_rng(seed)
    stamped = START + (np.arange(int(rate * seconds)) * 1e9 / rate).astype(np.int64)
    delay = 0.003 + rng.exponential(0.004, len(stamped))
    return Track(
        stream=name,
        received=stamped + np.round(delay * 1e9).astype(np.int64),
        stamped=stamped,
        values=np.empty((len(stamped), 0)),
        frames=(),
    )


def set_by(one: Track, seconds: float, share: float = 0.4) -> Track:
    stamped = one.stamped.copy()
    stamped[int(share * len(stamped)) :] += round(seconds * 1e9)
    return replace(one, stamped=stamped)


@pytest.mark.parametrize("step", [0.06, -0.25, 0.9, -7.0, 3600.0])
def test_stamps_after_a_clock_was_set_are_moved_back(step: float) -> None:
    poses, clouds = track("poses", 100, 1), track("clouds", 30, 2)
    notes = ImportNotes()
    moved = without_jumps({"pose": poses, "cloud": set_by(clouds, step)}, notes)
    np.testing.assert_array_equal(moved["pose"].stamped, poses.stamped)
    off = (moved["cloud"].stamped - clouds.stamped) / 1e9
    assert np.abs(off).max() < 0.005
    (warning,) = notes.warnings
    told = float(warning.partition("jumps by ")[2].partition(" s ")[0])
    assert told == pytest.approx(-step, abs=0.005) and "its clock was set" in warning


def test_two_jumps_of_one_clock_are_both_removed() -> None:
    clouds = track("clouds", 30, 2)
    notes = ImportNotes()
    tracks = {"pose": track("poses", 100, 1), "cloud": set_by(set_by(clouds, 0.5, 0.3), -0.2, 0.7)}
    moved = without_jumps(tracks, notes)
    assert np.abs(moved["cloud"].stamped - clouds.stamped).max() < 5e6
    assert len(notes.warnings) == 2


def test_a_clock_of_the_receipt_that_was_set_moves_no_stamp() -> None:
    poses, clouds = track("poses", 100, 1), track("clouds", 30, 2)
    when = START + 20 * 10**9
    late = {
        role: replace(one, received=one.received + np.where(one.stamped > when, 400_000_000, 0))
        for role, one in {"pose": poses, "cloud": clouds}.items()
    }
    notes = ImportNotes()
    moved = without_jumps(late, notes)
    np.testing.assert_array_equal(moved["cloud"].stamped, clouds.stamped)
    np.testing.assert_array_equal(moved["pose"].stamped, poses.stamped)
    assert len(notes.warnings) == 2 and "the recorder's clock was set" in notes.warnings[0]


def test_stalls_drift_and_stray_stamps_are_no_jumps() -> None:
    clouds = track("clouds", 30, 2)
    stalled = clouds.received.copy()
    # Half a second in which nothing arrives, and then all at once.
    inside = slice(600, 615)
    stalled[inside] = np.maximum(stalled[inside], clouds.received[615])
    drift = np.round(0.01 * (clouds.stamped - START)).astype(np.int64)
    stray = clouds.stamped.copy()
    stray[::97] = 12345
    assert not find_jumps(replace(clouds, received=stalled))
    assert not find_jumps(replace(clouds, stamped=clouds.stamped - drift))
    assert not find_jumps(replace(clouds, stamped=stray))
    assert not find_jumps(clouds) and not find_jumps(replace(clouds, has_receipt=False))


def test_good_recordings_have_no_jumps() -> None:
    found = [find_jumps(track("s", rate, seed)) for rate in (5, 30, 200) for seed in range(20)]
    assert not any(found)
