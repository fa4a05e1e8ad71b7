"""Values that no soft phantom and no tool for it have."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.dataset.check import check_dataset
from palpate.dataset.check.plausibility import implausible_values
from palpate.dataset.schema import DatasetConfig
from palpate.setup.box import Box


@pytest.fixture
def config(tmp_path: Path) -> DatasetConfig:
    return open_dataset(write_valid_dataset(tmp_path / "block")).config


def test_a_usual_phantom_raises_no_doubt(config: DatasetConfig) -> None:
    assert implausible_values(config, Box(size=config.size)) == []


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"mass": 1e-5}, r"mass = 1e-05 kg on .* soft phantoms have 300 to 3000 kg/m3"),
        ({"mass": 3.0}, r"mass = 3 kg on .* is 3.*e\+04 kg/m3"),
        ({"young_modulus": 5.0}, r"young_modulus = 5 Pa; soft phantoms have 100 to"),
        ({"touch_offset": 0.035}, r"touch_offset = 35 mm; the centre of a ball of 5 mm"),
        ({"touch_offset": -0.035}, r"touch_offset = -35 mm"),
        ({"tool_radius": 0.03}, r"tool.radius = 30 mm makes a ball of 60 mm for a phantom of"),
    ],
)
def test_an_implausible_value_is_told_with_its_bound(
    config: DatasetConfig, values: dict[str, Any], told: str
) -> None:
    (text,) = implausible_values(replace(config, **values), Box(size=config.size))
    assert re.search(told, text), text


def test_the_check_of_a_dataset_tells_it(tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    toml = folder / "dataset.toml"
    toml.write_text(toml.read_text().replace("mass = 0.1", "mass = 9.1", 1))
    assert any(
        "phantom.mass = 9.1" in text for text in check_dataset(open_dataset(folder)).warnings
    )
