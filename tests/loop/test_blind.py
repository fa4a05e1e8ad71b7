"""The whole loop, blind: an effect drawn at a fresh seed has to be named, and nothing where nothing is hidden."""

from __future__ import annotations

import secrets
from dataclasses import replace
from pathlib import Path
from typing import Any

from core.dataset import open_dataset
from core.diagnosis import diagnose
from core.synthetic import SHORT_PROTOCOL, Scenario, draw_scenario, make_dataset


def _diagnosed(scenario: Scenario, seed: int, folder: Path) -> dict[str, Any]:
    make_dataset(folder / "hidden", replace(scenario, sequences=SHORT_PROTOCOL), seed, workers=2)
    return diagnose(open_dataset(folder / "hidden"), folder / "run", workers=2, replays=False)


def test_effect_of_a_fresh_seed_is_named(tmp_path: Path) -> None:
    seed = secrets.randbelow(1_000_000)
    scenario = draw_scenario(seed)
    print(f"seed {seed}: {scenario.effects}")  # noqa: T201 (a failure must be repeatable)
    report = _diagnosed(scenario, seed, tmp_path)
    assert report["verdict"] == "found", f"seed {seed}: {report['verdict']}"
    assert {cause["effect"] for cause in report["causes"]} == {effect.effect for effect in scenario.effects}, f"seed {seed}"


def test_control_without_any_effect_names_none(tmp_path: Path) -> None:
    report = _diagnosed(Scenario(), 11, tmp_path)
    assert report["verdict"] == "none"
    assert report["causes"] == []
