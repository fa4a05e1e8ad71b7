from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from shapes import dome

from palpate.app.reporting.timeline_series import (
    contact_force,
    models_of,
    push_depth,
    timeline_series,
    touching,
    worst_frames,
)
from palpate.app.storage.run_store import RecordedReplay, Run
from palpate.fem.newton import Outcome


@pytest.fixture
def run(place: Any, run_name: str) -> Run:
    return Run(place.runs / run_name)


@pytest.fixture
def replay(run: Run) -> RecordedReplay:
    return run.replay("poke-01")


def moved(replay: RecordedReplay, **arrays: Any) -> RecordedReplay:
    return RecordedReplay(replay.name, {**replay.arrays, **arrays})


def test_depth_from_above_is_how_far_the_ball_is_below_the_top(replay: RecordedReplay) -> None:
    np.testing.assert_allclose(
        push_depth(replay), 0.003 * np.sin(np.pi * np.linspace(0.1, 0.9, 5)), atol=1e-8
    )


def test_depth_from_the_side_and_at_an_edge_is_measured_along_the_shortest_way(
    replay: RecordedReplay,
) -> None:
    half = replay.size / 2
    centres = [
        [half[0] + 0.004, 0, 0.01],
        [half[0] + 0.003, 0, 2 * half[2] + 0.004],
        [half[0] + 0.006, 0, 0.01],
        [0, 0, 0.001],
    ]
    depth = push_depth(moved(replay, tool_raw=np.array(centres)))
    np.testing.assert_allclose(depth, [0.001, 0.0, 0.0, 0.005 + half[1]], atol=1e-7)


def test_depth_in_a_free_form_is_measured_along_its_normals(replay: RecordedReplay) -> None:
    body = dome((0.04, 0.03, 0.025))
    surface = body.surface(2.5e-3)
    places = body.surface_points()[::100]
    normals = body.facing(places)[1]
    deep = np.linspace(-0.002, 0.003, len(places))
    centres = places + (0.005 - deep)[:, None] * normals
    found = push_depth(moved(replay, rest=surface.vertices, faces=surface.faces, tool_raw=centres))
    np.testing.assert_allclose(found, np.maximum(deep, 0.0), atol=1e-4)


def test_spells_of_touch_are_first_and_last_frames() -> None:
    assert touching(np.array([1.0, 0, 0, 2, 3, 0, 1])) == [[0, 0], [3, 4], [6, 6]]
    assert touching(np.zeros(4)) == []


def test_force_is_the_size_of_the_measured_one_at_the_frames(
    run: Run, replay: RecordedReplay
) -> None:
    assert contact_force(run, replay) == pytest.approx([0.1, 0.3, 0.5, 0.7, 0.9])
    assert contact_force(run, run.replay("drag-01")) is None


def test_force_outside_its_recording_is_not_made_up(run: Run, replay: RecordedReplay) -> None:
    force = contact_force(run, moved(replay, time=np.array([99.0, 100.2, 101.5])))
    assert force is not None
    assert np.isnan(force).tolist() == [True, False, True]


def test_worst_frames_are_the_peaks_the_highest_first() -> None:
    errors = np.array([0, 1, 3, 2.9, 0, np.nan, 5, 0, 0, 2, 0, 0, 0, 1, 0], dtype=float)
    assert worst_frames(errors) == [6, 2, 9]
    assert worst_frames(np.full(3, np.nan)) == []


def test_a_frame_without_contact_is_none_of_the_worst(run: Run, replay: RecordedReplay) -> None:
    errors = np.array([1.0, 2.0, 9.0, 2.0, 1.0]) * 1e-4
    centres = np.array(replay["tool_raw"])
    told = timeline_series(run, moved(replay, distance_raw=errors))
    assert told["worst"][0] == 2
    centres[2, 2] += 0.1
    told = timeline_series(run, moved(replay, distance_raw=errors, tool_raw=centres))
    assert 2 not in told["worst"] and told["worst"]


def test_a_peak_beside_a_higher_one_is_not_told_twice() -> None:
    errors = np.zeros(48)
    errors[[20, 23, 30]] = 5.0, 4.0, 1.0
    assert worst_frames(errors)[:2] == [20, 30]


def test_forces_and_failures_of_each_model_are_told_where_recorded(
    run: Run, replay: RecordedReplay
) -> None:
    plain = timeline_series(run, replay)
    assert (plain["forces"], plain["failed"]) == (None, {})
    kept = moved(
        replay,
        force_raw=np.arange(5) / 10,
        outcome_raw=np.array([0, 0, 1, 0, Outcome.GIVEN_UP.code]),
        outcome_extended=np.zeros(5),
    )
    assert timeline_series(run, kept)["forces"] == {"raw": [0.0, 0.1, 0.2, 0.3, 0.4]}
    told = timeline_series(run, kept)
    assert told["failed"] == {"raw": [2, 4], "extended": []}
    assert told["reasons"]["raw"][0].endswith("the reason was not recorded")
    assert told["reasons"]["raw"][1].startswith("the push was given up")


def test_series_of_a_third_model_and_iterations_are_told_where_recorded(
    run: Run, replay: RecordedReplay
) -> None:
    assert models_of(replay) == ("raw", "extended")
    assert timeline_series(run, replay)["iterations"] is None
    more = {f"{key}corrected": replay[f"{key}extended"] for key in ("", "error_", "distance_")}
    told = timeline_series(run, moved(replay, **more, iterations_raw=np.arange(5)))
    assert told["models"] == ["raw", "extended", "corrected"]
    assert told["iterations"] == {"raw": [0, 1, 2, 3, 4]}
    assert told["touching"] == [[0, 4]]
