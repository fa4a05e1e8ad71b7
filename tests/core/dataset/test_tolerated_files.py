"""Files that are right although they look odd are read, and advice names what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_dataset import ply_bytes, small_cloud, write_valid_dataset

from palpate.consistency import check_consistency
from palpate.dataset import open_dataset
from palpate.dataset.dataset_problems import find_problems
from palpate.foundation.errors import DatasetError

POKE = "sequences/poke-01"


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_valid_dataset(tmp_path / "block")


@pytest.mark.parametrize("name", ["@eaDir", "#recycle", "$RECYCLE.BIN", "__MACOSX", ".cache"])
def test_folders_of_file_servers_are_no_sequences(folder: Path, name: str) -> None:
    (folder / "sequences" / name).mkdir()
    assert open_dataset(folder).sequences == ("drag-01", "poke-01")


def test_backslashes_in_the_list_of_clouds_are_read(folder: Path) -> None:
    path = folder / POKE / "clouds.csv"
    path.write_text(path.read_text().replace("clouds/", "clouds\\"))
    assert len(open_dataset(folder).sequence("poke-01").cloud(0)) == 192
    assert find_problems(folder) == []


def test_a_comment_of_a_cloud_may_hold_any_characters(folder: Path) -> None:
    header = b"ply\ncomment von J\xfcrgen\n"
    (folder / "rest.ply").write_bytes(ply_bytes(small_cloud()).replace(b"ply\n", header, 1))
    assert len(open_dataset(folder).rest_cloud()) == 192


def test_few_points_without_depth_are_left_out_and_told(folder: Path) -> None:
    points = small_cloud()
    points[7] = [0.0, 0.0, 65.535]
    for number in range(5):
        (folder / POKE / f"clouds/{number:06d}.ply").write_bytes(ply_bytes(points))
    dataset = open_dataset(folder)
    assert len(dataset.sequence("poke-01").cloud(0)) == 191
    assert any("1 of 192 points" in text for text in check_consistency(dataset, None))


def test_many_far_points_are_another_unit(folder: Path) -> None:
    (folder / "rest.ply").write_bytes(ply_bytes(1e3 * small_cloud()))
    with pytest.raises(DatasetError, match="did you write millimetres"):
        open_dataset(folder).rest_cloud()


def test_stamps_with_too_few_digits_are_named_as_such(folder: Path) -> None:
    path = folder / POKE / "kinematics.csv"
    header, *rows = path.read_text().split()
    short = [f"{1.6e9 + float(row.split(',')[0]):g},{row.split(',', 1)[1]}" for row in rows]
    path.write_text("\n".join([header, *short]) + "\n")
    with pytest.raises(DatasetError, match=r"199 of 200 stamps repeat .* too few digits"):
        open_dataset(folder)


@pytest.mark.parametrize(
    ("change", "advice"),
    [
        (lambda t: t + 1.6e9, "convert the stamps to one clock"),
        (lambda t: 1e3 * t, "did you write milliseconds"),
    ],
)
def test_forces_of_another_clock_are_refused_by_their_own_name(
    folder: Path, change: object, advice: str
) -> None:
    path = folder / POKE / "forces.csv"
    header, *rows = path.read_text().split()
    times = change(np.array([float(row.split(",")[0]) for row in rows]))  # type: ignore[operator]
    moved = [f"{t:.6f},{row.split(',', 1)[1]}" for t, row in zip(times, rows, strict=True)]
    path.write_text("\n".join([header, *moved]) + "\n")
    with pytest.raises(DatasetError, match=f"forces.csv, row 2: .* an overlap: {advice}"):
        open_dataset(folder)
    assert [error.where["file"] for error in find_problems(folder)] == [f"{POKE}/forces.csv"]
