"""Frames of a sweep are those that press deep, at places that differ."""

from __future__ import annotations

import numpy as np

from palpate.sweep.frame_choice import informative_frames


def test_deepest_frame_of_each_push_is_chosen_before_those_that_hardly_touch() -> None:
    depth = np.tile(np.concatenate([np.linspace(0, 4, 20), np.linspace(4, 0, 20)]), 3) * 1e-3
    centres = np.repeat([[0.0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]], 40, axis=0)
    chosen = informative_frames(centres, depth, depth > 0, 3)
    assert (np.diff(chosen) > 0).all()
    assert set(chosen // 40) == {0, 1, 2}
    assert (depth[chosen] > 3.9e-3).all()
    more = informative_frames(centres, depth, depth > 0, 9)
    assert set(chosen) <= set(more)
    assert depth[more].mean() > 2e-3
    # A place that is known adds a depth that is not.
    assert np.ptp(depth[more]) > 1e-3


def test_few_touched_frames_are_all_taken() -> None:
    depth = np.array([-1, 1, 2, -1, 3.0]) * 1e-3
    chosen = informative_frames(np.zeros((5, 3)), depth, depth > 0, 8)
    np.testing.assert_array_equal(chosen, [1, 2, 4])


def test_no_frame_is_chosen_twice_where_the_tool_rests() -> None:
    chosen = informative_frames(np.zeros((30, 3)), np.full(30, 2e-3), np.ones(30, dtype=bool), 6)
    assert len(set(chosen.tolist())) == 6
