"""Comparison of frames with clouds, done once if two setups cannot differ."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
from pushed_block import GRID, SETUP, TOP, poke, seen_points

from palpate.foundation.frames import Transform
from palpate.measurement.surface_gaps import gaps
from palpate.recording.record_sequence import ModelRecording, compare_with_clouds
from palpate.replay.replay import replay
from palpate.setup.setup import Material, Sensor

CENTRES = np.array([poke(-8e-3), poke(-6e-3), poke(3e-3)])
SOFTER = replace(SETUP, material=Material(poisson_ratio=0.3))
ELSEWHERE = replace(
    SETUP, sensor=Sensor(camera_shift=Transform(translation=np.array([5e-4, 0.0, 0.0])))
)


def _clouds() -> list[np.ndarray]:
    return [
        seen_points(frame, 3000, 2e-4, number)
        for number, frame in enumerate(replay(SETUP, CENTRES, GRID))
    ]


def _same(one: ModelRecording, other: ModelRecording) -> bool:
    names = [part.name for part in fields(ModelRecording) if part.name != "inside"]
    return all(
        np.array_equal(getattr(one, name), getattr(other, name), equal_nan=True) for name in names
    )


def _looks(monkeypatch) -> list[int]:
    """A list that grows by the number of points whenever a cloud is compared with a surface."""
    seen = list[int]()

    def counted(points, *rest, **known):
        seen.append(len(points))
        return gaps(points, *rest, **known)

    monkeypatch.setattr("palpate.recording.record_sequence.gaps", counted)
    return seen


def test_frames_at_rest_are_copied_from_the_other_setup(monkeypatch):
    clouds, frames = _clouds(), replay(SOFTER, CENTRES, GRID)
    stated = compare_with_clouds(SETUP, replay(SETUP, CENTRES, GRID), clouds)
    alone, looks = compare_with_clouds(SOFTER, frames, clouds), _looks(monkeypatch)
    after = compare_with_clouds(SOFTER, frames, clouds, (SETUP, stated))
    assert len(looks) == 1  # of the frame that is pushed
    assert _same(after, alone)
    assert not np.array_equal(after.error[2], stated.error[2], equal_nan=True)


def test_frames_are_compared_again_with_another_camera_pose(monkeypatch):
    clouds, frames = _clouds(), replay(ELSEWHERE, CENTRES, GRID)
    stated = compare_with_clouds(SETUP, replay(SETUP, CENTRES, GRID), clouds)
    alone, looks = compare_with_clouds(ELSEWHERE, frames, clouds), _looks(monkeypatch)
    after = compare_with_clouds(ELSEWHERE, frames, clouds, (SETUP, stated))
    assert len(looks) == 3
    assert _same(after, alone)
    assert np.nanmean(np.abs(after.error[0] - stated.error[0])) > 1e-4


def test_frame_at_rest_in_one_setup_only_is_compared_again(monkeypatch):
    barely = np.array([[4e-3, -2e-3, TOP + 5.3e-3]])
    clouds = [seen_points(frame, 3000, 2e-4, 0) for frame in replay(SETUP, barely, GRID)]
    larger = replace(SETUP, tool=replace(SETUP.tool, radius=6.5e-3))
    pressed = compare_with_clouds(larger, replay(larger, barely, GRID), clouds)
    looks = _looks(monkeypatch)
    compare_with_clouds(SETUP, replay(SETUP, barely, GRID), clouds, (larger, pressed))
    assert pressed.force[0] > 0 and len(looks) == 1
