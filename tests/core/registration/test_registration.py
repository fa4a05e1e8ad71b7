from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import Dataset, Touches, open_dataset
from palpate.foundation.frames import Transform
from palpate.registration.registration import register, setup_from


def off(stated: Transform, true: Transform, point: np.ndarray) -> np.ndarray:
    motion = true @ stated.inverse()
    return np.concatenate([motion.apply(point) - point, motion.rotation_vector])


def truth_of(path: Path) -> tuple[Transform, Transform]:
    """True phantom_from_robot and phantom_from_camera."""
    truth = json.loads((path.parent / f"{path.name}.truth.json").read_text())["registration"]
    robot = Transform(
        np.array(truth["robot_from_phantom_R"]), np.array(truth["robot_from_phantom_t"])
    )
    return robot.inverse(), Transform.from_matrix(truth["phantom_from_camera"])


def relabelled(dataset: Dataset, order: list[int]) -> Dataset:
    names = dataset.touches.names
    return replace(
        dataset, touches=Touches(tuple(names[k] for k in order), dataset.touches.positions)
    )


@pytest.mark.parametrize("guessed", [True, False])
def test_both_poses_of_measured_datasets_are_found_within_their_uncertainty(
    measured_datasets, guessed
):
    squares = []
    for path in measured_datasets:
        dataset = open_dataset(path)
        if not guessed:
            dataset = replace(dataset, config=replace(dataset.config, to_phantom=None))
        found = register(dataset)
        robot, camera = truth_of(path)
        camera_off = off(found.phantom_from_camera, camera, found.camera_pivot)
        robot_off = off(found.phantom_from_robot, robot, found.robot_pivot)
        assert (
            np.linalg.norm(camera_off[:3]) < 3e-4
            and np.degrees(np.linalg.norm(camera_off[3:])) < 0.3
        )
        assert (
            np.linalg.norm(robot_off[:3]) < 5e-4 and np.degrees(np.linalg.norm(robot_off[3:])) < 1.0
        )
        squares.append(camera_off @ np.linalg.solve(found.camera_covariance, camera_off) / 6)
        squares.append(robot_off @ np.linalg.solve(found.robot_covariance, robot_off) / 6)
        assert found.warnings == () and found.proposal is None and found.weak_directions == ()
    assert np.mean(squares) < 2.0


def test_corners_named_half_a_turn_off_give_a_warning_by_the_tool_in_the_clouds(measured_datasets):
    found = register(relabelled(open_dataset(measured_datasets[0]), [2, 3, 0, 1]))
    assert found.proposal is None
    assert any("half a turn" in text for text in found.warnings)


@pytest.mark.parametrize("order", [[1, 0, 2, 3], [1, 2, 3, 0], [3, 2, 1, 0], [1, 0, 3, 2]])
def test_wrong_pairings_are_proposed_and_never_applied(measured_datasets, order):
    dataset = open_dataset(measured_datasets[0])
    stated = relabelled(dataset, order)
    found = register(stated)
    assert found.proposal is not None
    assert found.proposal.sentence in found.warnings
    assert found.touch_rms == pytest.approx(found.proposal.rms_as_stated)
    corrected = register(
        replace(stated, touches=Touches(found.proposal.pairing, stated.touches.positions))
    )
    assert corrected.touch_rms < 5e-4 and corrected.proposal is None


def test_a_touched_polygon_twelve_percent_too_small_is_proposed_in_percent(measured_datasets):
    dataset = open_dataset(measured_datasets[0])
    places = dataset.touches.positions
    shrunk = places.mean(axis=0) + 0.88 * (places - places.mean(axis=0))
    found = register(replace(dataset, touches=Touches(dataset.touches.names, shrunk)))
    assert found.proposal is not None and found.proposal.scale == pytest.approx(0.88, abs=0.02)
    assert any("doubtful" in text for text in found.warnings)


def test_setup_holds_what_the_experimenter_believes_and_the_registrations(measured_datasets):
    dataset = open_dataset(measured_datasets[0])
    found = register(dataset)
    setup = setup_from(dataset, found)
    assert setup.geometry.size == dataset.config.size
    assert setup.tool.radius == dataset.config.tool_radius
    assert setup.phantom_from_camera is found.phantom_from_camera


def test_progress_runs_from_nothing_to_all(measured_datasets):
    fractions: list[float] = []
    register(open_dataset(measured_datasets[0]), lambda fraction, text: fractions.append(fraction))
    assert fractions[0] == 0.0 and fractions[-1] == 1.0 and fractions == sorted(fractions)
