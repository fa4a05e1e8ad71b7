"""Recordings that lie are told, each in several forms, and a sound one is not."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from deceptions import DECEPTIONS
from recorded_block import write_recorded_block

from palpate.consistency import check_consistency
from palpate.dataset import open_dataset
from palpate.dataset.check import check_dataset
from palpate.effects.elastic_material import PoissonRatio, YoungModulus
from palpate.effects.tool import ToolRadius
from palpate.foundation.errors import PalpateError
from palpate.registration.registration import register
from palpate.setup.bounds import MODULI, POISSON_RATIOS, TOOL_RADII
from palpate.setup.setup import Box, Material, Setup, Tool

QUICK = (
    "forces: sign",
    "forces: grams",
    "forces: one value",
    "forces: 2 s early",
    "touches: 25 mm along x",
    "clouds: x mirrored",
    "rest: phantom 12 mm",
    "landmarks: 90 degrees",
    "robot: zeros",
    "camera: every second repeated",
    "camera: an offset each",
    "quaternions: w first",
    "mass: 20 700 kg/m3",
)
"""At least one form of each kind; the others are of the second tier."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_recorded_block(tmp_path_factory.mktemp("recorded") / "block")


def told(folder: Path) -> list[str]:
    """All that is told about a dataset, an error included."""
    try:
        dataset = open_dataset(folder)
        registration = register(dataset)
        summary = check_dataset(dataset, registration.phantom_from_robot)
        found = check_consistency(dataset, registration)
        return [*summary.warnings, *registration.warnings, *found]
    except PalpateError as error:
        return [error.message]


def test_a_sound_recording_is_not_doubted(sound: Path) -> None:
    assert told(sound) == []


@pytest.mark.parametrize(
    "name",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.more) for name in DECEPTIONS],
)
def test_a_lie_is_told(sound: Path, tmp_path: Path, name: str) -> None:
    folder = tmp_path / "block"
    shutil.copytree(sound, folder)
    shutil.copy(f"{sound}.truth.json", f"{folder}.truth.json")
    DECEPTIONS[name].change(folder)
    texts = told(folder)
    assert any(re.search(DECEPTIONS[name].told, text) for text in texts), texts


@pytest.mark.parametrize("end", [0, 1])
def test_effects_begin_at_every_number_that_can_be_stated(end: int) -> None:
    material = Material(young_modulus=MODULI[end], poisson_ratio=POISSON_RATIOS[end])
    tool = Tool(radius=TOOL_RADII[end])
    setup = Setup(geometry=Box(size=(0.07, 0.04, 0.04)), tool=tool, material=material, mass=0.1)
    assert ToolRadius.neutral(setup).radius == TOOL_RADII[end]
    assert YoungModulus.neutral(setup).E == MODULI[end]
    assert PoissonRatio.neutral(setup)
