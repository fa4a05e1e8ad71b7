"""The whole loop at a fixed seed: an effect is hidden by another solver, and the diagnosis has to name it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from core.dataset import open_dataset
from core.diagnosis import diagnose
from core.effects import DIAGNOSED, from_json
from core.synthetic import HiddenEffect, Scenario, make_dataset

FEW = ("poke-top-01", "poke-top-02", "poke-top-03", "poke-side-01")


def named(report: dict[str, Any]) -> set[str]:
    return {cause["effect"] for cause in report["causes"]}


@pytest.fixture(scope="module")
def late_clock(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A run folder and its report; the camera's clock is 150 ms late."""
    folder = tmp_path_factory.mktemp("late") / "late"
    make_dataset(folder, Scenario(effects=(HiddenEffect("time_offset", {"offset": 0.15}),), sequences=FEW), 5, workers=2)
    run = folder.parent / "run"
    return run, diagnose(open_dataset(folder), run, workers=2)


def test_late_clock_is_named_with_its_size(late_clock: tuple[Path, dict[str, Any]]) -> None:
    _, report = late_clock
    assert report["verdict"] == "found"
    assert named(report) == {"time_offset"}
    offset = report["causes"][0]["parameters"]["offset"]
    assert offset["value"] == pytest.approx(0.15, abs=0.02)
    assert offset["low"] < offset["value"] < offset["high"]


def test_the_map_of_what_can_be_told_is_whole_and_sees_the_hidden_clock(late_clock: tuple[Path, dict[str, Any]]) -> None:
    rows = {row["effect"]: row for row in late_clock[1]["ambiguity_map"]}
    assert set(rows) == {effect.name for effect in DIAGNOSED}
    assert 0.5e-3 < rows["time_offset"]["limits"][0]["change"] < 0.05  # a third of what is hidden at most
    for name, row in rows.items():
        assert {one["effect"] for one in row["alike"]} == set(rows) - {name}
        assert all(0.0 <= one["share"] <= 1.0 for one in row["alike"])


def test_naming_it_removes_most_of_the_error_on_unseen_sequences(late_clock: tuple[Path, dict[str, Any]]) -> None:
    gain = late_clock[1]["gain"]
    assert gain["split"] == "test"
    assert gain["extended"] < gain["baseline"]
    assert gain["reducible_removed"]["value"] > 0.5


def test_run_folder_holds_everything_that_the_page_needs(late_clock: tuple[Path, dict[str, Any]]) -> None:
    run, report = late_clock
    assert json.loads((run / "report.json").read_text()) == report
    model = json.loads((run / "model.json").read_text())
    assert from_json(model["effects"][0]).name == "time_offset"
    assert (run / "pictures" / "patterns.png").stat().st_size > 5000
    for name in FEW:
        with np.load(run / "replays" / f"{name}.npz") as replay:
            assert replay["raw"].shape == replay["extended"].shape == (len(replay["time"]), len(replay["rest"]), 3)
            assert np.isfinite(replay["raw"]).all()
            assert (replay["outcome"] == 0).all()
            assert np.nanmean(replay["distance_extended"]) < np.nanmean(replay["distance_raw"])
