from __future__ import annotations

import json

import numpy as np
import pytest

from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.point_pairs import directions, fit_pairs, register_pairs
from palpate.registration.pose import small_motion
from palpate.setup.box import Box

SIZE = (0.0687, 0.0393, 0.0358)
TOP = np.array([0.0, 0.0, SIZE[2]])
X, Y, Z = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]
MESH = np.array([[X, Y, Z], [-X, Y, Z], [-X, -Y, Z], [X, -Y, 0.0]])
POSE = Transform.from_vector([0.01, -0.15, 0.25], [-2.4, 0.2, 0.1])
CLOUD = POSE.inverse().apply(MESH)


@pytest.mark.parametrize("count", [3, 4])
def test_exact_pairs_give_the_exact_pose(count):
    fit = fit_pairs(CLOUD[:count], MESH[:count])
    assert np.allclose(fit.phantom_from_camera.matrix, POSE.matrix, atol=1e-9)
    assert fit.rms < 1e-9 and fit.warnings == ()


def test_one_bad_pair_is_named():
    cloud = CLOUD.copy()
    cloud[1] += [0.012, 0.012, 0.0]
    fit = fit_pairs(cloud, MESH)
    assert fit.misses.argmax() == 1 and "Pair 2" in fit.warnings[0]


def refusal(cloud, mesh):
    with pytest.raises(RegistrationError) as caught:
        fit_pairs(cloud, mesh)
    return caught.value.message


def test_pairs_that_cannot_tell_are_refused():
    assert "at least 3" in refusal(CLOUD[:2], MESH[:2])
    assert "each pair needs both" in refusal(CLOUD[:3], MESH[:2])
    assert "pairs 1 and 4 have the same point on the cloud" in refusal(CLOUD[[0, 1, 2, 0]], MESH)
    assert "pairs 1 and 4 have the same point on the mesh" in refusal(CLOUD, MESH[[0, 1, 2, 0]])
    assert "no number" in refusal(CLOUD * np.nan, MESH)
    line = np.linspace(MESH[0], MESH[1], 3)
    assert "one line" in refusal(POSE.inverse().apply(line), line)


def test_pairs_that_were_exchanged_are_named():
    with pytest.raises(
        RegistrationError, match="exchanging the mesh points of pairs 1 and 2 would fit"
    ) as caught:
        fit_pairs(CLOUD[:3], MESH[[1, 0, 2]])
    assert caught.value.where["pairs"] == "1, 2"


def test_nearly_collinear_pairs_are_warned_of():
    mesh = np.array([[-X, 0.0, Z], [X, 0.0, Z], [0.0, 0.1 * X * np.sqrt(3), Z]])
    fit = fit_pairs(POSE.inverse().apply(mesh), mesh)
    assert sum("nearly on one line" in text for text in fit.warnings) == 2


def test_mirrored_pairs_are_refused_in_space_and_in_a_plane():
    left_right = np.array([-1.0, 1.0, 1.0])
    assert "a reflection leaves" in refusal(CLOUD, MESH * left_right)
    assert "under the table" in refusal(CLOUD[:3], MESH[:3] * left_right)


def test_sloppy_clicks_and_icp_arrive_at_the_pose(scene):
    view = scene().look(seed=3)
    rng = np.random.default_rng(1)
    clicked = view.pose.inverse().apply(MESH[:3]) + rng.normal(0, 2e-3, (3, 3))
    result = register_pairs(view.cloud, Box(size=SIZE), clicked, MESH[:3])
    off = view.pose @ result.camera.phantom_from_camera.inverse()
    assert np.linalg.norm(off.apply(TOP) - TOP) < 5e-4
    assert np.degrees(np.linalg.norm(off.rotation_vector)) < 0.5
    assert result.after < result.before and result.points > 1000
    plain = json.loads(json.dumps(result.to_json()))
    assert Transform.from_matrix(plain["phantom_from_camera"]).matrix == pytest.approx(
        result.camera.phantom_from_camera.matrix
    )
    shift, turn = result.moved
    motion = result.pairs.phantom_from_camera @ view.pose.inverse()
    assert shift == pytest.approx(np.linalg.norm(motion.apply(TOP) - TOP), abs=5e-4)
    assert turn == pytest.approx(np.linalg.norm(motion.rotation_vector), abs=np.radians(0.5))


def test_a_start_by_hand_keeps_its_heading(scene):
    view = scene().look(seed=4)
    turned = Transform(np.diag([-1.0, -1.0, 1.0])) @ view.pose
    clicked = turned.inverse().apply(MESH[:3])
    found = register_pairs(view.cloud, Box(size=SIZE), clicked, MESH[:3]).camera.phantom_from_camera
    assert np.degrees(np.linalg.norm((turned @ found.inverse()).rotation_vector)) < 0.5


def test_directions_come_weakest_first_with_their_names():
    found = directions(np.diag([1.0, 4.0, 9.0, 100.0, 1.0, 1.0]) * 1e-6, lever=0.1)
    assert found[0]["sigma"] == pytest.approx(3e-3)
    assert abs(found[0]["parts"]["translation along z"]) == pytest.approx(1.0)
    assert found[-1]["sigma"] == pytest.approx(1e-4)


def test_the_start_is_not_doubted_as_a_stated_guess(scene):
    view = scene().look(seed=6)
    start = small_motion(np.array([0.016, 0.0, 0.0, 0.0, 0.0, 0.0]), TOP) @ view.pose
    result = register_pairs(view.cloud, Box(size=SIZE), start.inverse().apply(MESH), MESH)
    assert not any("from [camera] to_phantom" in text for text in result.to_json()["warnings"])
    assert result.moved[0] == pytest.approx(0.016, abs=5e-4)


def test_a_cloud_that_icp_turns_away_from_the_pairs_is_doubted(scene):
    view = scene().look(seed=6)
    start = small_motion(np.array([0.0, 0.0, 0.0, 0.0, 0.0, np.radians(24.0)]), TOP) @ view.pose
    result = register_pairs(view.cloud, Box(size=SIZE), start.inverse().apply(MESH), MESH)
    assert result.moved[1] > np.radians(15.0)
    assert "from where the pairs put it" in result.to_json()["warnings"][0]
    good = register_pairs(view.cloud, Box(size=SIZE), view.pose.inverse().apply(MESH), MESH)
    assert not any("from where the pairs put it" in text for text in good.warnings)
