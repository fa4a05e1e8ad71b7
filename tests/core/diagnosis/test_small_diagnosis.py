"""A whole diagnosis, as small as one can be: another solver presses with a larger tool."""

from __future__ import annotations

from pathlib import Path

import pytest
from large_tool import RADIUS, large_tool_dataset

from palpate.dataset import open_dataset
from palpate.diagnosis import DiagnosisResult
from palpate.diagnosis.pipeline import diagnose


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return large_tool_dataset(tmp_path_factory.mktemp("small") / "large-tool")


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
