"""Stamps that deceive are dropped, moved, or told with what they leave open."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.importing.clocks.common_clock import on_common_clock
from palpate.importing.clocks.stream_times import StreamTimes, stream_times
from palpate.importing.clocks.track import Stamps, Track
from palpate.importing.import_notes import ImportNotes

START = 1_700_000_000 * 10**9


def track(
    name: str, stamped: Stamps, delay: np.ndarray | float = 0.003, has_receipt: bool = True
) -> Track:
    """A stream whose messages are received a delay [s] after their true time, here their stamp."""
    received = stamped + np.round(np.broadcast_to(delay, stamped.shape) * 1e9).astype(np.int64)
    none = np.empty((len(stamped), 0))
    return Track(
        stream=name, received=received, stamped=stamped, values=none, frames=(),
        has_receipt=has_receipt,
    )  # fmt: skip


def ticks(rate: float, seconds: float) -> Stamps:
    return START + (np.arange(int(rate * seconds)) * 1e9 / rate).astype(np.int64)


def with_stamps(one: Track, stamped: Stamps) -> Track:
    return Track(
        stream=one.stream, received=one.received, stamped=stamped, values=one.values,
        frames=one.frames,
    )  # fmt: skip


def related(poses: Track, clouds: Track, notes: ImportNotes) -> StreamTimes:
    tracks = {"pose": poses, "cloud": clouds}
    times = {role: stream_times(one, notes) for role, one in tracks.items()}
    return on_common_clock(tracks, times, "pose", notes)["cloud"]


def test_good_header_stamps_are_taken_as_they_are() -> None:
    notes = ImportNotes()
    poses, clouds = track("poses", ticks(100, 20)), track("clouds", ticks(30, 20), 0.04)
    times = related(poses, clouds, notes)
    np.testing.assert_array_equal(times.times, clouds.stamped)
    assert not notes.warnings and not notes.decisions


def test_a_repeat_half_a_microsecond_back_is_dropped_and_counted() -> None:
    stamped = np.insert(ticks(100, 3), 150, ticks(100, 3)[149] - 560)
    notes = ImportNotes()
    times = stream_times(track("poses", stamped, 0.0), notes)
    assert len(times.times) == 300 and (np.diff(times.times) > 0).all()
    assert notes.decisions == [
        "poses: 1 of 301 samples do not come later than the one before (up to 0.56 us back): "
        "dropped"
    ]
    assert not notes.warnings


def test_many_repeats_are_a_warning() -> None:
    notes = ImportNotes()
    times = stream_times(track("poses", np.repeat(ticks(100, 3), 2)), notes)
    assert len(times.times) == 300
    assert "300 of 600 stamps do not increase" in notes.warnings[0]


def test_zero_stamps_leave_the_receipt() -> None:
    true = ticks(100, 3)
    notes = ImportNotes()
    times = stream_times(with_stamps(track("poses", true), np.zeros_like(true)), notes)
    np.testing.assert_array_equal(times.times, true + 3_000_000)
    assert "has no header stamps" in notes.warnings[0]


def test_single_zero_and_stray_stamps_are_dropped_and_counted() -> None:
    true = ticks(100, 10)
    stamped = true.copy()
    stamped[[10, 400]] = 0
    stamped[500] += 3600 * 10**9
    notes = ImportNotes()
    times = stream_times(with_stamps(track("poses", true), stamped), notes)
    assert len(times.times) == 997
    assert notes.decisions == [
        "poses: 2 of 1000 samples have a header stamp of zero: dropped",
        "poses: 1 of 1000 samples have a stray header stamp: dropped",
    ]


def test_bursts_of_receipts_are_spread_evenly_and_said_to_be_uncertain() -> None:
    true = ticks(100, 10)
    bursts = true[9::10].repeat(10) + np.tile(np.arange(10) * 20_000, 100)
    one = track("poses", true)
    late = Track(
        stream="poses", received=bursts, stamped=np.zeros_like(true), values=one.values, frames=()
    )
    notes = ImportNotes()
    times = stream_times(late, notes)
    steps = np.diff(times.times) / 1e9
    np.testing.assert_allclose(steps, 0.01, atol=1e-4)
    assert (times.times <= bursts + 1000).all()
    assert 0.05 < times.uncertainty < 0.15
    assert "bursts" in notes.warnings[1]


@pytest.mark.parametrize("epoch", [-1.7e9, -20543620.0, 3600.0])
def test_a_device_clock_of_another_epoch_is_moved_within_its_stated_bound(epoch: float) -> None:
    rng = np.random.default_rng(0)
    true = ticks(30, 60)
    clouds = track("clouds", true, 0.02 + rng.exponential(0.005, len(true)))
    clouds = with_stamps(clouds, true + int(epoch * 1e9))
    poses = track("poses", ticks(100, 60), 0.002 + rng.exponential(0.002, 6000))
    notes = ImportNotes()
    times = related(poses, clouds, notes)
    # The least delay of the clouds, 20 ms, cannot be told from an offset of their clock.
    off = (times.times - true[times.rows]) / 1e9
    assert np.abs(off - 0.018).max() < 0.003
    assert np.ptp(off) < 1e-3
    assert 0.005 < times.uncertainty < 0.05
    assert "least delays of delivery, uncertain by" in notes.warnings[0]


@pytest.mark.parametrize("drift", [0.01, -0.0005])
def test_a_clear_drift_of_a_clock_is_removed(drift: float) -> None:
    rng = np.random.default_rng(0)
    true = ticks(30, 120)
    elapsed = true - START
    clouds = track("clouds", true, 0.02 + rng.exponential(0.002, len(true)))
    clouds = with_stamps(clouds, true + np.round(drift * elapsed).astype(np.int64))
    poses = track("poses", ticks(100, 120), 0.002 + rng.exponential(0.002, 12000))
    notes = ImportNotes()
    times = related(poses, clouds, notes)
    left = np.polyfit(elapsed[times.rows] / 1e9, (times.times - true[times.rows]) / 1e9, 1)[0]
    assert abs(left) < 0.02 * abs(drift)
    assert any("drifts by" in one and "removed" in one for one in notes.warnings)


def test_a_drift_that_the_delays_hide_is_left_and_carried_as_uncertainty() -> None:
    rng = np.random.default_rng(3)
    true = ticks(10, 30)
    wander = np.repeat(rng.normal(0, 0.02, 30), 10)
    clouds = track("clouds", true, 0.1 + wander)
    notes = ImportNotes()
    times = related(track("poses", ticks(100, 30)), clouds, notes)
    np.testing.assert_array_equal(times.times, clouds.stamped[times.rows])
    assert not any("removed" in one for one in notes.warnings)


def test_rows_of_a_table_have_no_receipt_to_judge_them_by() -> None:
    notes = ImportNotes()
    stamped = np.arange(100, dtype=np.int64) * 10**7
    times = stream_times(track("table", stamped, 0.0, has_receipt=False), notes)
    np.testing.assert_array_equal(times.times, stamped)
    assert not notes.warnings and not notes.decisions


def test_clouds_without_stamps_follow_the_poses_clock() -> None:
    true = ticks(30, 20)
    clouds = with_stamps(track("clouds", true, 0.01), np.zeros_like(true))
    poses = track("poses", ticks(100, 20), 0.002)
    poses = with_stamps(poses, poses.stamped - 500 * 10**9)
    notes = ImportNotes()
    times = related(poses, clouds, notes)
    off = (times.times - (true - 500 * 10**9)) / 1e9
    np.testing.assert_allclose(off, 0.008, atol=1e-3)
    assert "only its receipt is known" in notes.warnings[-1]
