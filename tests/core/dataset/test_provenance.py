"""The digest of a dataset's files, and results made from other data than there are now."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest
from small_dataset import write_valid_dataset

from palpate.dataset.provenance import (
    check_data,
    check_unchanged,
    data_changed,
    dataset_digest,
    made_from,
)
from palpate.foundation.errors import DatasetError, RunError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_valid_dataset(tmp_path / "block")


def test_copies_later_times_and_hidden_files_leave_the_digest(folder: Path, tmp_path: Path) -> None:
    before = dataset_digest(folder)
    (folder / ".DS_Store").write_text("x")
    os.utime(folder / "dataset.toml", (1, 1))
    copy = shutil.copytree(folder, tmp_path / "elsewhere")
    assert dataset_digest(folder) == dataset_digest(copy) == before
    assert dataset_digest(folder, full=True) == dataset_digest(copy, full=True) != before


@pytest.mark.parametrize("change", ["content", "name", "new", "gone"])
def test_every_change_of_a_file_changes_the_digest(folder: Path, change: str) -> None:
    before, table = dataset_digest(folder), folder / "sequences" / "poke-01" / "kinematics.csv"
    if change == "content":
        text = table.read_text()
        table.write_text(text[:-2] + ("1" if text[-2] != "1" else "2") + text[-1])
    elif change == "name":
        table.rename(table.with_name("kinematics-old.csv"))
    elif change == "new":
        (folder / "sequences" / "poke-01" / "forces.csv").write_text("t,fx,fy,fz\n")
    else:
        table.unlink()
    assert dataset_digest(folder) != before


def test_large_file_is_read_in_blocks_that_hold_both_ends(folder: Path) -> None:
    large = folder / "surface.ply"
    content = bytearray(2**20)
    large.write_bytes(content)
    before, whole = dataset_digest(folder), dataset_digest(folder, full=True)
    for place in (0, 2**20 - 1):
        changed = content.copy()
        changed[place] = 1
        large.write_bytes(changed)
        assert dataset_digest(folder) != before
    between = content.copy()
    between[2**17] = 1  # between two blocks: only the full digest sees it
    large.write_bytes(between)
    assert dataset_digest(folder) == before
    assert dataset_digest(folder, full=True) != whole


def test_what_was_made_from_other_data_is_told_and_is_not_resumed(folder: Path) -> None:
    made = made_from(folder)
    assert set(made) == {"data", "version", "commit", "code"}
    assert data_changed(folder, made) is False
    check_data(made, made_from(folder), "sweep", "one")
    check_data({}, made_from(folder), "sweep", "an old one")
    check_unchanged(folder, made)
    with (folder / "dataset.toml").open("a") as stream:
        stream.write("# edited\n")
    assert data_changed(folder, made) is True
    now = made_from(folder)
    with pytest.raises(RunError, match=f"{made['data']}.*{now['data']}"):
        check_data(made, now, "sweep", "one")
    with pytest.raises(DatasetError, match=f"{made['data']}.*{now['data']}"):
        check_unchanged(folder, made)


def test_nothing_is_told_of_unknown_data(folder: Path, tmp_path: Path) -> None:
    assert data_changed(folder, {}) is None
    assert data_changed(tmp_path / "gone", made_from(folder)) is None
