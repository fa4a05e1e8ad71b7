"""The whole loop, once for all its tests: an effect is hidden by another solver, or nothing, and the diagnosis has to tell.

How often that goes wrong is what the full suite counts; PALPATE_SEED draws another case than the one that has always been right.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
from looping import SLIPPING_BASE, Loop, looped, seed_or

from app.blind_page import blind_page
from core.blind import Result, draw_cases, summary_of
from core.blind.cases import scenario_of
from core.effects import DIAGNOSED, from_json

pytestmark = pytest.mark.timeout(2400)
"""The first test waits for both diagnoses: on two busy cores that are slow, too, one takes a quarter of an hour."""


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> tuple[Loop, Result]:
    control = draw_cases(11, 1, kinds=["control"], short=True)
    found, (nothing,) = looped(tmp_path_factory.mktemp("loop"), seed_or(SLIPPING_BASE), control)
    return found, nothing


@pytest.fixture
def loop(both: tuple[Loop, Result]) -> Loop:
    return both[0]


@pytest.fixture
def nothing(both: tuple[Loop, Result]) -> Result:
    return both[1]


def test_effect_that_was_drawn_is_named(loop: Loop) -> None:
    found = loop.found
    assert found.right, f"seed {loop.seed}: {found.verdict}, {found.named} where {found.hidden} is hidden"
    assert found.report["gain"]["noise_floor"] > 0 and found.probabilities[found.named[0]] > 0.5


def test_nothing_is_named_where_nothing_is_hidden(nothing: Result) -> None:
    assert (nothing.error, nothing.verdict, nothing.causes) == ("", "none", [])


def test_suite_counts_both_and_leaves_nothing_but_its_results(loop: Loop, nothing: Result) -> None:
    results = [loop.found, nothing]
    summary = summary_of(results, loop.seed)
    assert [summary["kinds"][kind]["right"]["hits"] for kind in ("clear", "control")] == [1, 1]
    assert "2 of 2 cases right" in blind_page(summary, results)
    assert [path.name for path in loop.suite.iterdir()] == ["results.jsonl"]


def test_slip_is_named_with_its_size(loop: Loop) -> None:
    if loop.seed != SLIPPING_BASE:
        pytest.skip("another effect was asked for")
    hidden = loop.found.hidden[0]["parameters"]["friction_coefficient"]["value"]
    coefficient = loop.report["causes"][0]["parameters"]["friction_coefficient"]
    assert coefficient["value"] == pytest.approx(hidden, rel=0.1)
    assert coefficient["low"] < hidden < coefficient["high"]


def test_the_map_of_what_can_be_told_is_whole_and_sees_what_is_hidden(loop: Loop) -> None:
    rows = {row["effect"]: row for row in json.loads((loop.run / "report.json").read_text())["ambiguity_map"]}
    assert set(rows) == {effect.name for effect in DIAGNOSED}
    for name, row in rows.items():
        assert {one["effect"] for one in row["alike"]} == set(rows) - {name}
        assert all(0.0 <= one["share"] <= 1.0 for one in row["alike"])
    assert all(rows[name]["limits"] for name in loop.found.named)


def test_naming_it_removes_most_of_the_error_on_unseen_sequences(loop: Loop) -> None:
    gain = loop.report["gain"]
    assert gain["split"] == "test"
    assert gain["extended"] < gain["baseline"]
    assert gain["reducible_removed"]["value"] > 0.5


def test_run_folder_holds_everything_that_the_page_needs(loop: Loop) -> None:
    written = json.loads((loop.run / "report.json").read_text())
    assert {**loop.report, "ambiguity_map": written["ambiguity_map"]} == written
    model = json.loads((loop.run / "model.json").read_text())
    assert [from_json(one).name for one in model["effects"]] == list(loop.found.named)
    assert (loop.run / "pictures" / "patterns.png").stat().st_size > 5000
    for name in scenario_of(loop.found.case).sequences:
        with np.load(loop.run / "replays" / f"{name}.npz") as replay:
            assert replay["raw"].shape == replay["extended"].shape == (len(replay["time"]), len(replay["rest"]), 3)
            assert np.isfinite(replay["raw"]).all()
            assert (replay["outcome"] == 0).all()
            assert np.nanmean(replay["distance_extended"]) < np.nanmean(replay["distance_raw"])
