"""Statements about forces and stamps: [force] and [motion] of dataset.toml."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.dataset.check.dataset_summary import check_dataset
from palpate.dataset.dataset_problems import find_problems
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


def test_forces_that_deviate_by_as_much_as_they_change_are_told(tmp_path: Path) -> None:
    root = stated(tmp_path / "block", "[force]\nsigma = 2.0\n")
    assert any("force.sigma = 2 N" in text for text in check_dataset(open_dataset(root)).warnings)
    file = root / "dataset.toml"
    file.write_text(file.read_text().replace("sigma = 2.0\n", "sigma = 1e-3\n"))
    told = check_dataset(open_dataset(root)).warnings
    assert not any("force.sigma" in text for text in told)


@pytest.mark.parametrize("value", ["-1.0", "1e6", '"large"'])
def test_a_deviation_out_of_bounds_is_named(tmp_path: Path, value: str) -> None:
    with pytest.raises(DatasetError, match=r"force.sigma = .* expected a number from 0 to 100 N"):
        open_dataset(stated(tmp_path / "block", f"[force]\nsigma = {value}\n"))


def at_rest(root: Path, rows: int, step: float, stamps: str = "") -> Path:
    """A sequence of depth steps, `step` seconds apart, and its forces; no clouds."""
    stated(root, f'[motion]\nstamps = "{stamps}"\n' if stamps else "")
    for name in ("poke-01", "drag-01"):
        home = root / "sequences" / name
        shutil.rmtree(home / "clouds")
        (home / "clouds.csv").unlink()
        time = [f"{at * step:.3f}" for at in range(rows)]
        path = [f"{t},0,0,{0.06 - 2e-4 * at:.5f},0,0,0,1" for at, t in enumerate(time)]
        (home / "kinematics.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *path]) + "\n")
        felt = [f"{t},0,0,{0.01 * at:.4f}" for at, t in enumerate(time)]
        (home / "forces.csv").write_text("\n".join(["t,fx,fy,fz", *felt]) + "\n")
    return root


def test_depth_steps_that_no_recording_in_milliseconds_has_are_read(tmp_path: Path) -> None:
    dataset = open_dataset(at_rest(tmp_path / "block", 60, 1.57))
    assert len(dataset.sequence("poke-01").kinematics.time) == 60
    summary = check_dataset(dataset)
    assert not any("pause" in text or "frames were lost" in text for text in summary.warnings)


def test_long_rows_of_depth_steps_are_asked_about_and_read_where_they_are_stated(
    tmp_path: Path,
) -> None:
    with pytest.raises(DatasetError, match=r'milliseconds\? .* \[motion\] stamps = "synthetic"'):
        open_dataset(at_rest(tmp_path / "asked", 1000, 1.57))
    dataset = open_dataset(at_rest(tmp_path / "stated", 1000, 1.57, "synthetic"))
    assert any("no measured times" in text for text in check_dataset(dataset).warnings)
    assert not find_problems(tmp_path / "stated")


def test_made_up_stamps_beside_clouds_are_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="yet there are clouds"):
        open_dataset(stated(tmp_path / "block", '[motion]\nstamps = "synthetic"\n'))
    with pytest.raises(DatasetError, match=r'motion.stamps = \'guessed\'; expected "measured"'):
        open_dataset(stated(tmp_path / "other", '[motion]\nstamps = "guessed"\n'))
