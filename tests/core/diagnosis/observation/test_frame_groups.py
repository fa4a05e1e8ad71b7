from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from pushed_block import POSE, SETUP, SIZE, TOP, seen_points
from small_dataset import ply_bytes

from palpate.dataset import Kinematics, Sequence
from palpate.dataset.tool_smoothing import SMOOTHING, smooth_centres
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.frame_groups import FAR, Observations
from palpate.diagnosis.observation.observe_clouds import observe
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.segmentation import Cleaner
from palpate.mesh.box_mesh import GridSpec
from palpate.registration.pose import small_motion
from palpate.replay.replay import rest
from palpate.setup.box import Box
from palpate.setup.setup import Sensor

BLOCK = Box(size=SIZE)

CLEANER = Cleaner(geometry=BLOCK, phantom_from_camera=POSE, tool_radius=5e-3, noise=4e-4)
FRAMES, RATE = 41, 20.0


def _stream(path: FloatArray, time: FloatArray) -> Kinematics:
    return Kinematics(time, path, np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)))


def _two_pushes(time: FloatArray) -> FloatArray:
    """Down to 4 mm into the top and up again to 20 mm above it, twice in two seconds; tool centres
    (n, 3) [m].
    """
    height = TOP + 5e-3 + 8e-3 + 12e-3 * np.cos(2 * np.pi * time)
    return np.stack([np.full_like(time, 3e-3), np.zeros_like(time), height], axis=1)


@pytest.fixture
def sequence(tmp_path: Path) -> Sequence:
    """Two pushes of one second each, twenty clouds a second; cloud i has 2000 + 30 i points."""
    still, files = rest(SETUP, GridSpec()), []
    (tmp_path / "sequences" / "poke-01").mkdir(parents=True)
    for number in range(FRAMES):
        files.append(f"sequences/poke-01/{number:06d}.ply")
        (tmp_path / files[-1]).write_bytes(
            ply_bytes(seen_points(still, 2000 + 30 * number, 3e-4, number))
        )
    time = np.arange(-0.2, 2.2, 2e-3)
    return Sequence(
        tmp_path,
        "poke-01",
        _stream(_two_pushes(time), time),
        np.arange(FRAMES) / RATE,
        tuple(files),
        None,
    )


def _observed(sequence: Sequence, most: int = 100, cloud: FloatArray | None = None) -> Observations:
    return observe(sequence, SETUP, CLEANER, None, most, cloud)


def test_smoothing_keeps_constant_speed():
    time = np.cumsum(np.random.default_rng(0).uniform(2e-3, 8e-3, 400))
    speed = np.array([0.03, -0.01, 0.02])
    times = np.linspace(time[0] + SMOOTHING, time[-1] - SMOOTHING, 50)
    found = smooth_centres(_stream(time[:, None] * speed, time), times)
    assert np.allclose(found, times[:, None] * speed, atol=1e-5)  # the stream is uneven


def test_smoothing_averages_the_robots_noise_away():
    time = np.arange(0, 20, 1e-3)
    noise = 5e-5 * np.random.default_rng(1).standard_normal((len(time), 3))
    times = np.arange(0.1, 19.9, 0.05)
    found = smooth_centres(_stream(noise, time), times)
    assert found.std() == pytest.approx(5e-5 / np.sqrt(2 * SMOOTHING * 1e3), rel=0.1)


def test_times_beyond_the_stream_read_its_ends():
    time = np.arange(0, 1, 5e-3)
    stream = _stream(np.stack([time, 0 * time, 0 * time], axis=1), time)
    assert np.allclose(smooth_centres(stream, np.array([-5.0, 7.0]))[:, 0], [time[0], time[-1]])


def test_groups_hold_frames_of_one_place_in_the_order_of_time(sequence):
    groups = _observed(sequence).groups
    centres = _two_pushes(np.arange(FRAMES) / RATE)
    frames = [frame for group in groups for frame in group.frames]
    assert frames == sorted(set(frames))
    assert len(frames) == FRAMES
    # Between the pushes the tool is away for thirteen frames: half a second after the release a new
    # group begins.
    later = [(len(a.frames), len(b.frames)) for a, b in pairwise(groups) if a.free and b.free]
    assert later == [(10, 3)]
    for group in groups:
        here = centres[list(group.frames)]
        clear = Box(size=SIZE).distance(here) > 6.5e-3
        assert (clear == group.free).all()
        assert group.free or np.linalg.norm(here - here[0], axis=1).max() < CRITERIA.grouping.travel
    assert any(len(group.frames) > 1 for group in groups if not group.free)


def test_pushes_are_numbered(sequence):
    groups = _observed(sequence).groups
    touched = [group.push for group in groups if not group.free]
    assert touched == sorted(touched) and set(touched) == {1, 2}
    assert touched.count(1) == touched.count(2)
    assert groups[0].free and groups[0].push == 0


def test_thinning_keeps_untouched_groups_and_the_whole_range_of_touched_ones(sequence):
    every, few = _observed(sequence).groups, _observed(sequence, most=5).groups
    touched = [group.frames for group in every if not group.free]
    kept = [group.frames for group in few if not group.free]
    assert len(kept) == 5 < len(touched)
    assert set(kept) <= set(touched) and kept[0] == touched[0] and kept[-1] == touched[-1]
    assert [group.frames for group in few if group.free] == [
        group.frames for group in every if group.free
    ]


def test_points_of_all_frames_of_a_group_are_cleaned_and_joined(sequence):
    for group in _observed(sequence).groups:
        raw = sum(sequence.count(frame) for frame in group.frames)
        assert min(0.5 * raw, CRITERIA.grouping.most_points_untouched) <= len(group.points) <= raw
        assert len(group.points) <= CRITERIA.grouping.most_points_untouched or not group.free
        assert Box(size=SIZE).distance(POSE.apply(group.points)).max() < 0.01


def test_rest_cloud_becomes_the_first_group(sequence):
    cloud = seen_points(rest(SETUP, GridSpec()), 3000, 3e-4, 99)
    item = _observed(sequence, cloud=cloud)
    first = item.groups[0]
    assert first.reference and first.free and first.frames == ()
    assert not any(group.reference for group in item.groups[1:])
    assert np.array_equal(item.centres(SETUP)[0], FAR)
    assert {tuple(point) for point in first.points} <= {tuple(point) for point in cloud}


def test_time_offset_moves_the_centres_back_along_the_path(sequence):
    item = _observed(sequence)
    late = item.centres(replace(SETUP, sensor=Sensor(time_offset=0.05)))
    times = [np.array(group.frames) / RATE for group in item.groups]
    wanted = np.array([smooth_centres(sequence.kinematics, t - 0.05).mean(axis=0) for t in times])
    assert np.allclose(late, wanted, atol=1e-12)
    assert np.abs(late - item.centres(SETUP)).max() > 1e-3


def test_grouping_holds_only_under_its_own_clock(sequence):
    late = replace(SETUP, sensor=Sensor(time_offset=0.12))
    stated, found = _observed(sequence), observe(sequence, late, CLEANER, None, 100)
    assert stated.grouping_holds(SETUP) and not stated.grouping_holds(late)
    assert found.grouping_holds(late) and not found.grouping_holds(SETUP)
    moved = _two_pushes(np.arange(FRAMES) / RATE - 0.12)
    for group in found.groups:
        here = moved[list(group.frames)]
        assert ((Box(size=SIZE).distance(here) > 6.5e-3) == group.free).all()
        assert group.free or np.linalg.norm(here - here[0], axis=1).max() < CRITERIA.grouping.travel


def test_centres_follow_the_robots_registration(sequence):
    item = _observed(sequence)
    motion = small_motion(np.array([1e-3, 0.0, -2e-3, 0.0, 0.02, 0.0]), np.array([0.0, 0.0, TOP]))
    moved = item.centres(replace(SETUP, phantom_from_robot=motion @ Transform()))
    assert np.allclose(moved, motion.apply(item.centres(SETUP)))


def test_deepest_places_are_those_between_groups(sequence):
    observed = _observed(sequence, most=4)
    way, centres = observed.path(SETUP)[1], observed.centres(SETUP)
    turns = [None if number is None else way[number] for number in observed.deepest_places(SETUP)]
    bottom = TOP + 5e-3 - 4e-3
    deep = [(turn, centre) for turn, centre in zip(turns, centres, strict=True) if turn is not None]
    assert len(deep) >= 2  # both pushes turn between groups
    assert all(turn[2] < centre[2] for turn, centre in deep)
    assert min(turn[2] for turn, _ in deep) == pytest.approx(bottom, abs=2e-4)
    assert turns[0] is None
