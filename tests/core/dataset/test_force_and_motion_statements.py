"""Statements about forces and stamps: [force] and [motion] of dataset.toml."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError


def stated(root: Path, text: str) -> Path:
    write_valid_dataset(root)
    file = root / "dataset.toml"
    file.write_text(file.read_text() + "\n" + text)
    return root


def test_the_stated_deviation_is_that_of_all_forces(tmp_path: Path) -> None:
    dataset = open_dataset(stated(tmp_path / "block", "[force]\nsigma = 2.0\n"))
    found = [one.forces.sigma for one in dataset.loaded if one.forces is not None]
    assert found and set(found) == {2.0}


@pytest.mark.parametrize("value", ["-1.0", "1e6", '"large"'])
def test_a_deviation_out_of_bounds_is_named(tmp_path: Path, value: str) -> None:
    with pytest.raises(DatasetError, match=r"force.sigma = .* expected a number from 0 to 100 N"):
        open_dataset(stated(tmp_path / "block", f"[force]\nsigma = {value}\n"))
