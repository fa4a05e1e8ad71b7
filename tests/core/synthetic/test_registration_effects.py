"""A virtual dataset whose registrations rest on a misread depth, another size and touches of the
wrong corners.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.dataset import Dataset, open_dataset
from palpate.effects import from_json
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import CameraModel, camera_model_for
from palpate.measurement.touch_correction import touch_correction, touched_places
from palpate.mesh.box_mesh import GridSpec
from palpate.registration.registration import Registration, register, setup_from
from palpate.setup.setup import Setup
from palpate.synthetic import HiddenEffect, Scenario, Truth, make_dataset

HIDDEN = (
    HiddenEffect("geometry_scale", {"scale_x": 1.03, "scale_y": 0.97, "scale_z": 0.95}),
    HiddenEffect("depth_bias", {"offset": 0.0, "scale": 1.02}),
    HiddenEffect("landmark_mismatch", {"pairing": "swap-1-2", "scale": 0.88, "inset": 1e-3}),
)
QUICK = Scenario(
    sequences=("poke-top-01",), fine=4.5e-3, density=900, rate=1.0, robot_rate=200.0, effects=HIDDEN
)
X, Y, Z = QUICK.size


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> tuple[Dataset, Truth, Registration]:
    folder = tmp_path_factory.mktemp("bench") / "registered"
    truth = make_dataset(folder, QUICK, seed=11)
    dataset = open_dataset(folder)
    return dataset, truth, register(dataset)


def _known(dataset: Dataset, found: Registration) -> Setup:
    """The stated setup with what is hidden, by the engine's effects of the same names."""
    setup = setup_from(dataset, found)
    for hidden in HIDDEN:
        setup = from_json({"effect": hidden.effect, "parameters": dict(hidden.parameters)}).apply(
            setup
        )
    return setup


def _apart(one: Transform, other: Transform) -> float:
    """Largest distance of the block's corners between two poses [m]."""
    corners: FloatArray = np.array(
        [[x * X / 2, y * Y / 2, z * Z] for x in (-1, 1) for y in (-1, 1) for z in (0, 1)]
    )
    return float(np.linalg.norm((one @ other.inverse()).apply(corners) - corners, axis=1).max())


def test_believed_is_the_stated_size_and_made_the_true_one(made):
    dataset, truth, _ = made
    assert dataset.config.size == pytest.approx(QUICK.size)
    assert QUICK.true_size == pytest.approx((1.03 * X, 0.97 * Y, 0.95 * Z))
    assert [effect["effect"] for effect in truth.as_dict()["effects"]] == [
        hidden.effect for hidden in HIDDEN
    ]
    assert truth.visibility > 0.5e-3


def test_touches_were_made_where_the_effect_says(made):
    dataset, truth, found = made
    touched = truth.robot_from_phantom.inverse().apply(dataset.touches.positions) - [
        0.0,
        0.0,
        dataset.config.touch_offset,
    ]
    assert np.abs(touched - touched_places(_known(dataset, found))).max() < 0.6e-3


def test_clouds_are_read_as_the_effect_says(made):
    dataset, truth, _ = made
    for sight, height, tolerance in (
        (CameraModel(truth.phantom_from_camera, 0.0, 1.02), 0.95 * Z, 0.5e-3),
    ):
        cloud = sight.place(dataset.rest_cloud())
        over = (
            (np.abs(cloud[:, 0]) < X / 2 - 4e-3)
            & (np.abs(cloud[:, 1]) < Y / 2 - 4e-3)
            & (np.abs(cloud[:, 2] - Z) < 8e-3)
        )
        assert np.median(cloud[over, 2]) == pytest.approx(height, abs=tolerance)


def test_known_causes_give_the_true_poses_of_robot_and_camera(made):
    dataset, truth, found = made
    setup = _known(dataset, found)
    robot = touch_correction(setup, GridSpec()) @ setup.phantom_from_robot
    true_robot = truth.robot_from_phantom.inverse()
    assert _apart(setup.phantom_from_robot, true_robot) > 5e-3
    assert _apart(robot, true_robot) < 1e-3
    assert _apart(setup.phantom_from_camera, truth.phantom_from_camera) > 4e-3
    assert _apart(camera_model_for(setup).pose, truth.phantom_from_camera) < 1.2e-3


def test_registration_says_that_two_corners_are_swapped_and_the_polygon_is_small(made):
    _, _, found = made
    warnings = " ".join(found.warnings)
    assert (
        "paired with the wrong landmarks" in warnings and "smaller than the landmarks" in warnings
    )
    assert found.proposal is not None and found.proposal.scale == pytest.approx(0.85, abs=0.04)


def test_scenario_without_effects_has_the_stated_size():
    assert replace(QUICK, effects=()).true_size == QUICK.size
