"""Drift of a block between sequences, on the virtual bench."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import Dataset, open_dataset
from palpate.foundation.frames import Transform
from palpate.measurement.phantom_drift import (
    align_sequences,
    measure_drift,
    recorded_camera,
    shift_sequences,
)
from palpate.measurement.segmentation import cleaner_for
from palpate.registration.registration import register, setup_from
from palpate.registration.robot.landmark_repair import LandmarkRepair
from palpate.registration.robot.robot_fit import RobotFit
from palpate.synthetic import HiddenEffect, Scenario, Truth, make_dataset

SLIPPERY = HiddenEffect("base_slip", {"friction_coefficient": 0.16})
MOVED = HiddenEffect("camera_registration", {"translation": 0.004, "rotation": 0.03})
QUICK = Scenario(
    sequences=("poke-side-01", "poke-side-02", "poke-top-01"),
    fine=4.5e-3,
    density=900,
    rate=2.0,
    robot_rate=200.0,
    put_back=False,
)


@pytest.fixture(scope="module")
def slid(tmp_path_factory: pytest.TempPathFactory) -> tuple[Dataset, Truth]:
    folder = tmp_path_factory.mktemp("slid") / "block"
    truth = make_dataset(folder, replace(QUICK, effects=(SLIPPERY,)), seed=5)
    return open_dataset(folder), truth


@pytest.fixture(scope="module")
def bumped(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """A block that stays, seen by a camera that was moved after the rest cloud."""
    folder = tmp_path_factory.mktemp("bumped") / "block"
    make_dataset(
        folder, replace(QUICK, sequences=("poke-top-01", "poke-top-02"), effects=(MOVED,)), seed=5
    )
    return open_dataset(folder)


def test_a_block_that_slid_is_found_where_it_lies(slid: tuple[Dataset, Truth]) -> None:
    dataset, truth = slid
    assert "poke-side-01" not in truth.begun
    assert {"poke-side-02", "poke-top-01"} == set(truth.begun)
    found = measure_drift(dataset, register(dataset))
    assert set(found) == {name for name, way in truth.begun.items() if np.hypot(*way) > 2e-4}
    for name, way in found.items():
        assert way == pytest.approx(truth.begun[name], abs=1.2e-4)


def test_drift_is_reported_and_removed(slid: tuple[Dataset, Truth]) -> None:
    dataset, _ = slid
    registration = register(dataset)
    moved, aligned = align_sequences(dataset, registration)
    assert len(aligned.warnings) == len(registration.warnings) + 1
    assert "rest.ply" in aligned.warnings[-1]
    assert "poke-side-02" in aligned.warnings[-1]
    assert (
        f"{1e3 * np.hypot(*measure_drift(dataset, registration)['poke-side-02']):.1f} mm"
        in aligned.warnings[-1]
    )
    assert measure_drift(moved, aligned) == {}
    assert align_sequences(moved, aligned) == (moved, aligned)


def test_clouds_and_tool_move_together_and_a_raw_cloud_can_be_put_beside_them(
    slid: tuple[Dataset, Truth],
) -> None:
    dataset, _ = slid
    registration = register(dataset)
    way = np.array([1e-3, -2e-3])
    moved = shift_sequences(dataset, registration, {"poke-side-02": way}).sequence("poke-side-02")
    raw, setup = dataset.sequence("poke-side-02"), setup_from(dataset, registration)
    pose = setup.phantom_from_camera
    assert pose.apply(moved.cloud(3)) == pytest.approx(
        pose.apply(raw.cloud(3)) - [1e-3, -2e-3, 0.0], abs=1e-9
    )
    assert recorded_camera(moved, pose).apply(raw.cloud(3)) == pytest.approx(
        pose.apply(moved.cloud(3)), abs=1e-9
    )
    assert recorded_camera(raw, pose) is pose
    robot = setup.phantom_from_robot
    path = robot.apply(moved.kinematics.position)
    assert path == pytest.approx(
        robot.apply(raw.kinematics.position) - [1e-3, -2e-3, 0.0], abs=1e-9
    )
    assert len(cleaner_for(dataset, registration).clean(moved.cloud(0)).indices) > 300


def test_drift_uses_the_repaired_directions_of_the_robot(slid: tuple[Dataset, Truth]) -> None:
    dataset, _ = slid
    registration = register(dataset)
    right = registration.phantom_from_robot
    turned = Transform.from_vector(np.zeros(3), np.array([0.0, 0.0, np.pi / 2])) @ right
    fit = RobotFit(
        right,
        registration.touch_residuals,
        registration.touch_rms,
        1e-4,
        registration.robot_pivot,
        registration.robot_covariance,
    )
    paired = replace(
        registration, phantom_from_robot=turned, repair=LandmarkRepair("turn-1", 1.0, fit, 1e-2)
    )
    moved = shift_sequences(dataset, paired, {"poke-side-02": np.array([1e-3, -2e-3])}).sequence(
        "poke-side-02"
    )
    step = right.rotate(
        moved.kinematics.position - dataset.sequence("poke-side-02").kinematics.position
    )
    assert step == pytest.approx(np.broadcast_to([-1e-3, 2e-3, 0.0], step.shape), abs=1e-9)


def test_a_camera_that_was_moved_is_no_block_that_slid(bumped: Dataset) -> None:
    registration = register(bumped)
    assert measure_drift(bumped, registration) == {}
    assert align_sequences(bumped, registration) == (bumped, registration)


def test_only_the_slid_block_of_another_solver_has_drift(measured_datasets: list[Path]) -> None:
    for path in measured_datasets:
        hidden = {
            entry["effect"]
            for entry in json.loads(path.with_name(f"{path.name}.truth.json").read_text())[
                "effects"
            ]
        }
        dataset = open_dataset(path)
        assert not measure_drift(dataset, register(dataset)) or "base_slip" in hidden
