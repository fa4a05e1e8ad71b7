"""A whole diagnosis, as small as one can be: another solver presses with a larger tool."""

from __future__ import annotations

from pathlib import Path

import pytest
from made_datasets import copy_dataset

from palpate.dataset import open_dataset
from palpate.diagnosis import DiagnosisResult
from palpate.diagnosis.pipeline import diagnose
from palpate.synthetic import HiddenEffect, Scenario

RADIUS = 6.5e-3
SCENARIO = Scenario(
    effects=(HiddenEffect("tool_radius", {"radius": RADIUS}),),
    sequences=("poke-top-01", "poke-top-02", "poke-side-01"),
    splits={"train": ("poke-top-01", "poke-side-01"), "validation": (), "test": ("poke-top-02",)},
    fine=4.5e-3,
    density=1500,
    rate=3.0,
    robot_rate=200.0,
    noise=0.3e-3,
)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("small") / "large-tool"
    copy_dataset(folder, SCENARIO, 3)
    return folder


def test_hidden_tool_is_named_with_its_radius_and_gains_on_the_test_push(
    dataset: Path, tmp_path: Path
) -> None:
    diagnose(open_dataset(dataset), tmp_path / "run", workers=1, replays=False, assurance=False)
    result = DiagnosisResult.load(tmp_path / "run")
    assert result.verdict == "found"
    (cause,) = result.causes
    radius = cause["parameters"]["radius"]
    assert cause["effect"] == "tool_radius"
    assert radius["low"] < RADIUS < radius["high"] and radius["value"] == pytest.approx(
        RADIUS, 0.03
    )
    assert result.gain is not None and result.gain["reducible_removed"]["low"] > 0.5
    assert result.report["criteria"]["version"] == result.model["criteria"]["version"]
    figure = result.plot_patterns(tmp_path / "patterns.png")
    assert len(figure.axes) == 3 and (tmp_path / "patterns.png").stat().st_size > 1000
