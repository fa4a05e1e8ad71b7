"""Broken datasets give one error with its place and the expectation, and are not changed."""

from __future__ import annotations

import json
import stat
from pathlib import Path

import pytest
from broken_datasets import BREAKAGES, write_valid_dataset

from palpate.dataset import open_dataset
from palpate.foundation.errors import DatasetError


def content(folder: Path) -> dict[str, object]:
    """Everything below a path: kind, bytes and time of change."""
    found: dict[str, object] = {}
    for path in [folder, *sorted(folder.rglob("*"))]:
        if path.is_symlink() or path.exists():
            state = path.lstat()
            found[str(path)] = (
                state.st_mode,
                state.st_mtime_ns,
                path.read_bytes() if stat.S_ISREG(state.st_mode) else b"",
            )
    return found


def read_everything(folder: Path) -> None:
    open_dataset(folder).validate()


def test_the_dataset_is_whole_before_it_is_broken(tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    before = content(tmp_path)
    read_everything(folder)
    assert content(tmp_path) == before


@pytest.mark.parametrize("name", BREAKAGES)
def test_broken_dataset_gives_one_error_that_names_place_and_expectation(
    name: str, tmp_path: Path
) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    breakage = BREAKAGES[name]
    breakage(folder)
    before = content(tmp_path)
    with pytest.raises(DatasetError) as caught:
        read_everything(folder)
    error = caught.value
    expected = {"file": str(folder)} | breakage.where
    assert {key: error.where.get(key) for key in expected} == expected, error.message
    assert str(expected["file"]) in error.message
    if "row" in expected:
        assert f"row {expected['row']}" in error.message
    if "key" in expected:
        assert str(expected["key"]) in error.message
    for words in breakage.says:
        assert words in error.message
    json.dumps(error.where, allow_nan=False)
    assert content(tmp_path) == before


def test_at_least_thirty_five_ways_to_break_a_dataset_are_tried() -> None:
    assert len(BREAKAGES) >= 35
