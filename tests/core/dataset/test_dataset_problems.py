from __future__ import annotations

import pytest
from small_dataset import write_valid_dataset

from palpate.dataset.dataset_problems import MOST, find_problems, refuse_problems
from palpate.foundation.errors import DatasetError


@pytest.fixture
def folder(tmp_path):
    return write_valid_dataset(tmp_path / "small")


def spoil(file, row, text):
    lines = file.read_text().split("\n")
    lines[row - 1] = text
    file.write_text("\n".join(lines))


def test_a_dataset_in_order_has_no_problem(folder):
    assert find_problems(folder) == []
    refuse_problems(folder)


def test_every_problem_is_named_with_file_and_row(folder):
    spoil(folder / "touches.csv", 3, "corner_1,1.0,nan,0.1")
    spoil(folder / "sequences/poke-01/kinematics.csv", 5, "100.02,1,2")
    spoil(folder / "sequences/poke-01/kinematics.csv", 9, "100.02,x,0,0,0,0,0,1")
    spoil(folder / "sequences/poke-01/forces.csv", 4, "100.02,0,0,inf")
    (folder / "sequences/drag-01/clouds/000001.ply").write_bytes(b"ply\nnothing")
    (folder / "sequences/drag-01/clouds/000003.ply").unlink()
    (folder / "rest.ply").write_bytes(b"")
    found = find_problems(folder)
    places = {(error.where["file"], error.where.get("row")) for error in found}
    wanted = {
        ("touches.csv", 3),
        ("sequences/poke-01/kinematics.csv", 5),
        ("sequences/poke-01/kinematics.csv", 9),
        ("sequences/poke-01/forces.csv", 4),
    }
    assert wanted <= places
    files = {file for file, _ in places}
    assert {
        "sequences/drag-01/clouds/000001.ply",
        "sequences/drag-01/clouds/000003.ply",
        "rest.ply",
    } <= files
    with pytest.raises(
        DatasetError, match=rf"{len(found)} problems were found, and nothing was taken"
    ) as caught:
        refuse_problems(folder)
    assert all(error.message in caught.value.message for error in found)


def test_one_problem_is_said_as_it_is(folder):
    (folder / "touches.csv").unlink()
    with pytest.raises(DatasetError, match=r"^touches\.csv: not found"):
        refuse_problems(folder)


def test_a_splits_typo_and_a_broken_toml_are_found(folder):
    text = (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(text.replace('test = ["drag-01"]', 'test = ["drag-02"]'))
    assert [error.where["key"] for error in find_problems(folder)] == ["splits.test"]
    (folder / "dataset.toml").write_text("format = ")
    (folder / "sequences/poke-01/kinematics.csv").unlink()
    assert {error.where["file"] for error in find_problems(folder)} == {
        "dataset.toml",
        "sequences/poke-01/kinematics.csv",
    }


def test_no_more_than_can_be_read_are_listed(folder):
    for number in range(2 * MOST):
        with (folder / "sequences/poke-01/clouds.csv").open("a") as file:
            file.write(f"{101 + number},clouds/none-{number}.ply\n")
    assert len(find_problems(folder)) == MOST
