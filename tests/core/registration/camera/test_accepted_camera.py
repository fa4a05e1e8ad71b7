from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from small_dataset import write_valid_dataset

from palpate.dataset import open_dataset
from palpate.dataset.accepted_registration import AcceptedRegistration, rest_digest
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.pose import small_motion
from palpate.registration.registration import register, setup_from


@pytest.fixture
def dataset(tmp_path):
    return open_dataset(write_valid_dataset(tmp_path / "small"))


def accepted(dataset, shift=0.001):
    """The automatic registration, moved a little along x."""
    found = register(dataset)
    moved = (
        small_motion(np.array([shift, 0, 0, 0, 0, 0.0]), found.camera_pivot)
        @ found.phantom_from_camera
    )
    return AcceptedRegistration(
        "by-hand",
        moved,
        found.camera_covariance / 2,
        found.camera_pivot,
        ("x is open",),
        3,
        1e-4,
        rest_digest(dataset.path),
    )


def test_what_was_accepted_is_the_camera_of_registration_and_setup(dataset):
    given = accepted(dataset)
    found = register(dataset.registered(given))
    assert np.array_equal(found.phantom_from_camera.matrix, given.phantom_from_camera.matrix)
    assert np.array_equal(found.camera_covariance, given.covariance)
    assert found.weak_directions == ("x is open",)
    assert np.array_equal(
        setup_from(dataset, found).phantom_from_camera.matrix, given.phantom_from_camera.matrix
    )
    assert not np.allclose(
        register(dataset).phantom_from_camera.matrix, given.phantom_from_camera.matrix, atol=1e-5
    )
    assert np.array_equal(
        register(dataset.registered(None)).phantom_from_camera.matrix,
        register(dataset).phantom_from_camera.matrix,
    )


def test_one_that_the_cloud_contradicts_is_doubted(dataset):
    lifted = accepted(dataset)
    high = Transform(
        lifted.phantom_from_camera.rotation,
        lifted.phantom_from_camera.translation + np.array([0, 0, 0.004]),
    )
    found = register(dataset.registered(replace(lifted, phantom_from_camera=high)))
    assert any("by-hand lies" in text and "look at it again" in text for text in found.warnings)


def test_one_of_another_rest_cloud_is_refused(dataset):
    with pytest.raises(RegistrationError, match=r"made from another rest\.ply"):
        dataset.registered(replace(accepted(dataset), rest="0" * 16))


def test_it_survives_json_and_what_is_not_whole_is_refused(dataset):
    given = accepted(dataset)
    again = AcceptedRegistration.from_json(json.loads(json.dumps(given.to_json())))
    assert np.allclose(
        again.phantom_from_camera.matrix, given.phantom_from_camera.matrix, atol=1e-12
    )
    same = ("name", "by", "pairs", "residual", "covariance", "pivot", "weak_directions", "rest")
    assert [again.to_json()[key] for key in same] == [given.to_json()[key] for key in same]
    for broken in (
        {},
        {"name": "a"},
        {**given.to_json(), "covariance": [1]},
        {**given.to_json(), "pivot": [0, 0, float("nan")]},
    ):
        with pytest.raises(RegistrationError, match="no accepted registration"):
            AcceptedRegistration.from_json(broken)
