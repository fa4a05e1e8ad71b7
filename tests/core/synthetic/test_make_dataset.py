"""Whole virtual datasets: format, clocks, determinism, and all or nothing."""

from __future__ import annotations

import filecmp
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import Dataset, open_dataset
from palpate.foundation.errors import RunError
from palpate.foundation.frames import Transform
from palpate.foundation.progress import silent
from palpate.synthetic import HiddenEffect, Scenario, Truth, make_dataset, truth_path

QUICK = Scenario(sequences=("poke-top-01",), fine=4.5e-3, density=900, rate=2.0, robot_rate=200.0)
LATE = HiddenEffect("time_offset", {"offset": 0.2})
MOVED = HiddenEffect("camera_registration", {"translation": 0.003, "rotation": 0.03})

Made = Callable[..., tuple[Dataset, Truth]]


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> tuple[Dataset, Truth]:
    folder = tmp_path_factory.mktemp("bench") / "plain"
    truth = make_dataset(folder, QUICK, seed=11)
    return open_dataset(folder), truth


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> tuple[Dataset, Truth]:
    folder = tmp_path_factory.mktemp("bench") / "late"
    truth = make_dataset(folder, replace(QUICK, effects=(LATE, MOVED)), seed=11)
    return open_dataset(folder), truth


def test_dataset_reads_back_in_the_format(plain: tuple[Dataset, Truth]) -> None:
    dataset, _ = plain
    sequence = dataset.sequence("poke-top-01")
    assert dataset.sequences == ("poke-top-01",)
    assert dataset.has_rest
    assert len(dataset.touches.names) == 4
    assert len(sequence) > 20
    assert np.all(np.isfinite(sequence.cloud(len(sequence) - 1)))
    assert sequence.kinematics.time[0] < sequence.cloud_times[0]
    assert sequence.kinematics.time[-1] > sequence.cloud_times[-1]


def test_truth_stands_beside_the_dataset_and_not_in_it(late: tuple[Dataset, Truth]) -> None:
    dataset, truth = late
    saved = json.loads(truth_path(dataset.path).read_text())
    assert saved["verdict"] == "found"
    assert saved["effects"][0] == {
        "effect": "time_offset",
        "parameters": {"offset": {"value": 0.2, "unit": "s"}},
    }
    assert saved["visibility_mm"] == pytest.approx(truth.visibility * 1e3, abs=1e-4)
    for path in dataset.path.rglob("*"):
        if path.suffix in {".toml", ".csv"}:
            assert "time_offset" not in path.read_text()


def test_nothing_hidden_gives_the_verdict_none(plain: tuple[Dataset, Truth]) -> None:
    _, truth = plain
    assert truth.as_dict()["verdict"] == "none"
    assert truth.visibility == 0.0


def test_true_registrations_relate_touches_and_rest_cloud_to_the_block(
    plain: tuple[Dataset, Truth],
) -> None:
    dataset, truth = plain
    touched = truth.robot_from_phantom.inverse().apply(dataset.touches.positions)
    stated = np.array([dataset.config.landmarks[name] for name in dataset.touches.names])
    assert (
        np.abs(touched - stated - np.array([0.0, 0.0, dataset.config.touch_offset])).max() < 0.6e-3
    )
    cloud = truth.phantom_from_camera.apply(dataset.rest_cloud())
    x, y, z = dataset.config.size
    over = (
        (np.abs(cloud[:, 0]) < x / 2 - 4e-3)
        & (np.abs(cloud[:, 1]) < y / 2 - 4e-3)
        & (cloud[:, 2] > z - 5e-3)
    )
    assert np.median(cloud[over, 2]) == pytest.approx(z, abs=0.5e-3)


def test_first_guess_of_the_camera_is_near_the_truth_but_not_it(
    plain: tuple[Dataset, Truth],
) -> None:
    dataset, truth = plain
    assert dataset.config.to_phantom is not None
    off: Transform = dataset.config.to_phantom @ truth.phantom_from_camera.inverse()
    assert 0.3e-3 < np.linalg.norm(off.translation) < 12e-3
    assert np.linalg.norm(off.rotation_vector) < np.deg2rad(5)


def test_tool_rests_for_two_seconds_before_the_first_touch(plain: tuple[Dataset, Truth]) -> None:
    dataset, truth = plain
    kinematics = dataset.sequence("poke-top-01").kinematics
    centre = truth.robot_from_phantom.inverse().apply(kinematics.position)
    low = centre[:, 2] < dataset.config.size[2] + dataset.config.tool_radius
    assert kinematics.time[low][0] - kinematics.time[0] > 2.0
    assert kinematics.time[-1] - kinematics.time[low][-1] > 2.5


def test_stamps_of_the_clouds_are_late_by_the_offset(
    plain: tuple[Dataset, Truth], late: tuple[Dataset, Truth]
) -> None:
    on_time, delayed = (one[0].sequence("poke-top-01") for one in (plain, late))
    assert np.array_equal(on_time.kinematics.time, delayed.kinematics.time)
    assert np.allclose(delayed.cloud_times - on_time.cloud_times, 0.2, atol=1e-4)


def test_moved_camera_sees_the_table_tilted(late: tuple[Dataset, Truth]) -> None:
    dataset, truth = late
    assert np.linalg.norm(truth.camera_shift.translation) == pytest.approx(0.003)
    cloud = dataset.sequence("poke-top-01").cloud(0)
    right = (truth.camera_shift @ truth.phantom_from_camera).apply(cloud)
    table = (np.abs(right[:, 2]) < 3e-3) & (np.linalg.norm(right[:, :2], axis=1) > 0.05)
    assert np.median(np.abs(right[table, 2])) < np.median(
        np.abs(truth.phantom_from_camera.apply(cloud)[table, 2])
    )


def test_same_seed_gives_the_same_files(plain: tuple[Dataset, Truth], tmp_path: Path) -> None:
    dataset, _ = plain
    make_dataset(tmp_path / "plain", QUICK, seed=11)
    files = [
        str(path.relative_to(dataset.path)) for path in dataset.path.rglob("*") if path.is_file()
    ]
    same, different, missing = filecmp.cmpfiles(
        dataset.path, tmp_path / "plain", files, shallow=False
    )
    assert (different, missing) == ([], [])
    assert len(same) == len(files)


def test_forces_are_written_beside_the_same_files(
    plain: tuple[Dataset, Truth], tmp_path: Path
) -> None:
    dataset, truth = plain
    make_dataset(tmp_path / "felt", replace(QUICK, force_noise=0.02), seed=11)
    files = [
        str(path.relative_to(dataset.path)) for path in dataset.path.rglob("*") if path.is_file()
    ]
    assert filecmp.cmpfiles(dataset.path, tmp_path / "felt", files, shallow=False)[1:] == ([], [])
    sequence = open_dataset(tmp_path / "felt").sequence("poke-top-01")
    assert sequence.forces is not None and dataset.sequence("poke-top-01").forces is None
    time, force = sequence.forces.time, sequence.forces.force @ truth.robot_from_phantom.rotation
    place = truth.robot_from_phantom.inverse().apply(sequence.kinematics.position_at(time))
    depth = dataset.config.size[2] + dataset.config.tool_radius - place[:, 2]
    assert np.median(np.diff(time)) == pytest.approx(1 / 250, rel=0.01)
    felt = force[depth > 0.9 * depth.max()].mean(axis=0) - force[depth < -1e-3].mean(axis=0)
    # Hertz, for a shallow push of a ball into a half space; the ball is pushed in deeper than its
    # radius.
    hertz = (
        4
        / 3
        * 5e3
        / (1 - 0.45**2)
        * np.sqrt(dataset.config.tool_radius)
        * (0.95 * depth.max()) ** 1.5
    )
    assert 0.6 * hertz < felt[2] < 1.4 * hertz  # the block pushes the tool up
    assert np.linalg.norm(felt[:2]) < 0.3 * felt[2]
    assert np.diff(force[depth < -1e-3], axis=0).std() == pytest.approx(0.02 * np.sqrt(2), rel=0.05)


def test_existing_folder_is_left_alone(tmp_path: Path) -> None:
    with pytest.raises(RunError, match="exists already"):
        make_dataset(tmp_path, QUICK, seed=1)


def test_cancelled_making_leaves_nothing(tmp_path: Path) -> None:
    class Stop(Exception):
        pass

    def stop(fraction: float, text: str) -> None:
        silent(fraction, text)
        raise Stop

    with pytest.raises(Stop):
        make_dataset(tmp_path / "half", QUICK, seed=1, report=stop)
    assert list(tmp_path.iterdir()) == []
