"""Datasets that are whole: what comes out of the reader is what was written."""

from __future__ import annotations

import os
import pickle
import time
from pathlib import Path

import numpy as np
import pytest
from small_dataset import SIZE, ply_bytes, small_cloud, write_valid_dataset

from palpate.dataset import Dataset, open_dataset
from palpate.foundation.errors import Cancelled, DatasetError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return write_valid_dataset(tmp_path / "block")


def test_everything_stated_is_read_back(folder: Path) -> None:
    dataset = open_dataset(folder)
    assert (dataset.name, dataset.sequences, dataset.has_rest) == (
        "small-block",
        ("drag-01", "poke-01"),
        True,
    )
    assert dataset.config.size == SIZE
    assert (dataset.config.young_modulus, dataset.config.poisson_ratio) == (5.0e3, 0.45)
    assert (dataset.config.train, dataset.config.validation, dataset.config.test) == (
        ("poke-01",),
        (),
        ("drag-01",),
    )
    assert dataset.touches.names == ("corner_0", "corner_1", "corner_2", "corner_3")
    np.testing.assert_allclose(dataset.rest_cloud(), small_cloud(), atol=1e-7)


def test_touches_keep_the_distances_of_their_landmarks(folder: Path) -> None:
    dataset = open_dataset(folder)
    landmarks = np.array([dataset.config.landmarks[name] for name in dataset.touches.names])
    for points in (dataset.touches.positions, landmarks):
        np.testing.assert_allclose(
            np.linalg.norm(points[0] - points[2]), np.hypot(SIZE[0], SIZE[1]), atol=1e-6
        )


def test_a_sequence_has_motion_clouds_and_forces(folder: Path) -> None:
    poke, drag = (open_dataset(folder).sequence(name) for name in ("poke-01", "drag-01"))
    assert len(poke) == 5
    assert poke.count(3) == len(poke.cloud(3)) == 192
    assert poke.forces is not None
    assert poke.forces.force.shape == (100, 3)
    assert drag.forces is None
    np.testing.assert_allclose(np.linalg.norm(poke.kinematics.quaternion, axis=1), 1, atol=1e-6)


def test_tool_position_is_linear_between_rows_and_stays_at_the_ends(folder: Path) -> None:
    motion = open_dataset(folder).sequence("poke-01").kinematics
    middle = (motion.time[10] + motion.time[11]) / 2
    found = motion.position_at(
        np.array([motion.time[10], middle, motion.time[0] - 5, motion.time[-1] + 5])
    )
    expected = [
        motion.position[10],
        (motion.position[10] + motion.position[11]) / 2,
        motion.position[0],
        motion.position[-1],
    ]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_arrays_cannot_be_changed_by_accident(folder: Path) -> None:
    dataset = open_dataset(folder)
    with pytest.raises(ValueError, match="read-only"):
        dataset.touches.positions[0] = 0
    with pytest.raises(ValueError, match="read-only"):
        dataset.sequence("poke-01").kinematics.position[0] = 0


def test_an_unknown_sequence_is_answered_with_the_nearest_name(folder: Path) -> None:
    with pytest.raises(DatasetError, match="did you mean 'poke-01'") as caught:
        open_dataset(folder).sequence("poke-1")
    assert caught.value.where == {"file": "sequences/poke-1", "value": "poke-1"}


def test_line_ends_and_byte_order_mark_of_other_systems_are_read(folder: Path) -> None:
    plain = open_dataset(folder).sequence("poke-01").kinematics
    for path in [*folder.rglob("*.csv"), folder / "dataset.toml"]:
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes().replace(b"\n", b"\r\n"))
    open_dataset(folder).validate()
    read = open_dataset(folder).sequence("poke-01").kinematics
    assert np.array_equal(read.time, plain.time)
    assert np.array_equal(read.position, plain.position)


def test_without_clouds_no_camera_and_no_rest_cloud_are_needed(folder: Path) -> None:
    for name in ("poke-01", "drag-01"):
        for path in (folder / "sequences" / name / "clouds").iterdir():
            path.unlink()
        (folder / "sequences" / name / "clouds").rmdir()
        (folder / "sequences" / name / "clouds.csv").unlink()
    (folder / "sequences/drag-01/forces.csv").write_text("t,fx,fy,fz\n200.0,0,0,0.1\n")
    (folder / "rest.ply").unlink()
    text = (folder / "dataset.toml").read_text()
    (folder / "dataset.toml").write_text(
        text.replace('[camera]\nname = "test camera"\ndepth_sigma = 0.002\n', "")
    )
    dataset = open_dataset(folder)
    dataset.validate()
    assert not dataset.has_rest
    assert [len(dataset.sequence(name)) for name in dataset.sequences] == [0, 0]


def test_hidden_files_and_notes_among_the_sequences_are_no_sequences(folder: Path) -> None:
    (folder / "sequences" / ".cache").mkdir()
    (folder / "sequences" / "README.md").write_text("notes")
    assert open_dataset(folder).sequences == ("drag-01", "poke-01")


def test_a_dataset_travels_to_a_worker_process(folder: Path) -> None:
    dataset = pickle.loads(pickle.dumps(open_dataset(folder)))
    assert isinstance(dataset, Dataset)
    assert dataset.sequence("poke-01").cloud(0).shape == (192, 3)


def test_reading_everything_reports_and_can_be_cancelled(folder: Path) -> None:
    seen: list[float] = []

    def stop(fraction: float, text: str) -> None:
        seen.append(fraction)
        if fraction >= 0.5:
            raise Cancelled

    with pytest.raises(Cancelled):
        open_dataset(folder).validate(stop)
    assert seen == sorted(seen)
    assert len(seen) == 6


def test_a_hundred_thousand_rows_of_kinematics_open_in_a_second(folder: Path) -> None:
    time_column = 100 + np.arange(100_000) / 1e3
    row = (
        (folder / "sequences/poke-01/kinematics.csv").read_text().splitlines()[1].partition(",")[2]
    )
    lines = ["t,x,y,z,qx,qy,qz,qw", *(f"{t:.4f},{row}" for t in time_column)]
    (folder / "sequences/poke-01/kinematics.csv").write_text("\n".join(lines) + "\n")
    start = time.process_time()
    dataset = open_dataset(folder)
    assert time.process_time() - start < 1.0
    np.testing.assert_allclose(dataset.sequence("poke-01").kinematics.time, time_column, atol=1e-9)


def test_a_thousand_clouds_open_without_reading_their_points(folder: Path) -> None:
    home = folder / "sequences/poke-01"
    (home / "clouds/000000.ply").write_bytes(ply_bytes(small_cloud()))
    for index in range(1000):
        os.link(home / "clouds/000000.ply", home / f"clouds/long-{index}.ply")
    stamps = [f"{100 + index / 1e3:.4f},clouds/long-{index}.ply" for index in range(1000)]
    (home / "clouds.csv").write_text("\n".join(["t,file", *stamps]) + "\n")
    start = time.process_time()
    assert len(open_dataset(folder).sequence("poke-01")) == 1000
    assert time.process_time() - start < 1.0


def test_repeated_touches_are_averaged_and_tell_their_deviation(tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    file, random = folder / "touches.csv", np.random.default_rng(3)
    head, *rows = file.read_text().split()
    once = open_dataset(folder).touches
    assert once.deviation is None
    made = []
    for row in rows:
        name, *place = row.split(",")
        for _ in range(6):
            noisy = np.array(place, dtype=float) + 3e-4 * random.standard_normal(3)
            made.append(",".join([name, *(f"{value:.7f}" for value in noisy)]))
    file.write_text("\n".join([head, *made]) + "\n")
    touches = open_dataset(folder).touches
    assert touches.names == once.names
    assert np.abs(touches.positions - once.positions).max() < 5e-4
    assert touches.deviation == pytest.approx(3e-4, rel=0.3)


def test_repeat_at_another_place_is_refused_with_its_row(tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    file = folder / "touches.csv"
    head, first, *rows = file.read_text().split()
    name, x, y, z = first.split(",")
    wrong = ",".join([name, f"{float(x) + 0.012:.7f}", y, z])
    file.write_text("\n".join([head, first, *rows, wrong]) + "\n")
    with pytest.raises(DatasetError, match=r"row 2 already, 12.0 mm from here") as caught:
        open_dataset(folder)
    assert caught.value.where["row"] == 6


def test_stated_deviation_of_touches_reaches_the_setup(tmp_path: Path) -> None:
    folder = write_valid_dataset(tmp_path / "block")
    file = folder / "dataset.toml"
    file.write_text(
        file.read_text().replace("touch_offset = 0.0", "touch_offset = 0.0\ntouch_sigma = 2e-4")
    )
    assert open_dataset(folder).config.touch_sigma == 2e-4
