"""The whole loop: an effect is hidden by another solver, and the diagnosis has to name it; and
nothing where nothing is hidden.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from looping import LATE_CLOCK, Loop

from palpate.app.reporting.blind_page import blind_page
from palpate.blind import summary_of
from palpate.blind.case_scenarios import scenario_of
from palpate.effects import DIAGNOSED, from_json

pytestmark = pytest.mark.timeout(2400)
"""The first test waits for both diagnoses: on two busy cores that are slow, too, one takes a
quarter of an hour."""


def test_effect_that_was_drawn_is_named(loop: Loop) -> None:
    found = loop.found
    assert found.right, (
        f"seed {loop.seed}: {found.verdict}, {found.named} where {found.hidden} is hidden"
    )
    assert found.report["gain"]["noise_floor"] > 0 and found.probabilities[found.named[0]] > 0.5


def test_nothing_is_named_where_nothing_is_hidden(loop: Loop) -> None:
    assert (loop.nothing.verdict, loop.nothing.causes) == ("none", [])


def test_suite_counts_both_and_leaves_nothing_but_its_results(loop: Loop) -> None:
    results = [loop.found, loop.nothing]
    summary = summary_of(results, loop.seed)
    assert [summary["kinds"][kind]["right"]["hits"] for kind in ("clear", "control")] == [1, 1]
    assert "2 of 2 cases right" in blind_page(summary, results)
    assert [path.name for path in loop.suite.iterdir()] == ["results.jsonl"]


def test_late_clock_is_named_with_its_size(loop: Loop) -> None:
    if loop.seed != LATE_CLOCK:
        pytest.skip("another effect was asked for")
    hidden = loop.found.hidden[0]["parameters"]["offset"]["value"]
    offset = loop.report["causes"][0]["parameters"]["offset"]
    assert offset["value"] == pytest.approx(hidden, abs=0.02)
    assert offset["low"] < hidden < offset["high"]


def test_the_map_of_what_can_be_told_is_whole_and_sees_the_hidden_clock(loop: Loop) -> None:
    rows = {
        row["effect"]: row
        for row in json.loads((loop.run / "report.json").read_text())["ambiguity_map"]
    }
    assert set(rows) == {effect.name for effect in DIAGNOSED if not effect.needs_shape}
    if loop.seed == LATE_CLOCK:
        assert (
            0.5e-3 < rows["time_offset"]["limits"][0]["change"] < 0.05
        )  # a third of what is hidden at most
    for name, row in rows.items():
        assert {one["effect"] for one in row["alike"]} == set(rows) - {name}
        assert all(0.0 <= one["share"] <= 1.0 for one in row["alike"])


def test_naming_it_removes_most_of_the_error_on_unseen_sequences(loop: Loop) -> None:
    gain = loop.report["gain"]
    assert gain["split"] == "test"
    assert gain["extended"] < gain["baseline"]
    assert gain["reducible_removed"]["value"] > 0.5


def test_run_folder_holds_everything_that_the_page_needs(loop: Loop) -> None:
    written = json.loads((loop.run / "report.json").read_text())
    assert {**loop.report, "ambiguity_map": written["ambiguity_map"]} == written
    assert set(written["made_from"]) == {"data", "version", "commit", "code", "seed", "tolerance"}
    model = json.loads((loop.run / "model.json").read_text())
    assert [from_json(one).name for one in model["effects"]] == list(loop.found.named)
    assert (loop.run / "pictures" / "patterns.png").stat().st_size > 5000
    for name in scenario_of(loop.found.case).sequences:
        with np.load(loop.run / "replays" / f"{name}.npz") as replay:
            assert (
                replay["raw"].shape
                == replay["extended"].shape
                == (len(replay["time"]), len(replay["rest"]), 3)
            )
            assert np.isfinite(replay["raw"]).all()
            assert (replay["outcome"] == 0).all()
            assert np.nanmean(replay["distance_extended"]) < np.nanmean(replay["distance_raw"])
