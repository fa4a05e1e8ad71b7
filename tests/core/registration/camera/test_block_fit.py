from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.block_fit import fit_camera
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.pose import small_motion

SIZE = (0.0687, 0.0393, 0.0358)
TOP = np.array([0.0, 0.0, SIZE[2]])
PLACES = [(-0.19, -0.21, 0.26), (0.15, 0.15, 0.25), (-0.14, -0.18, 0.27)]


def error(fit: CameraFit, pose: Transform) -> np.ndarray:
    """Translation [m] of the top's centre and rotation [rad] that lead from the fit to the
    truth."""
    off = pose @ fit.phantom_from_camera.inverse()
    return np.concatenate([off.apply(TOP) - TOP, off.rotation_vector])


def guessed(pose: Transform, seed: int, shift: float = 3e-3, turn: float = 0.03) -> Transform:
    rng = np.random.default_rng(seed)
    return (
        small_motion(np.concatenate([rng.normal(0, shift, 3), rng.normal(0, turn, 3)]), TOP) @ pose
    )


@pytest.mark.parametrize("camera", PLACES)
def test_a_guessed_pose_is_refined_below_three_tenths_of_a_millimetre_and_degree(scene, camera):
    view = scene(camera=camera).look(seed=3)
    off = error(fit_camera(view.cloud, SIZE, 0.002, guessed(view.pose, seed=4)), view.pose)
    assert np.linalg.norm(off[:3]) < 3e-4
    assert np.degrees(np.linalg.norm(off[3:])) < 0.3


@pytest.mark.parametrize("camera", PLACES)
def test_without_a_guess_the_pose_is_found_up_to_half_a_turn_which_is_said(scene, camera):
    view = scene(camera=camera).look(seed=5)
    fit = fit_camera(view.cloud, SIZE, 0.002)
    turned = Transform(np.diag([-1.0, -1.0, 1.0])) @ view.pose
    off = min((error(fit, pose) for pose in (view.pose, turned)), key=np.linalg.norm)
    assert np.linalg.norm(off[:3]) < 3e-4
    assert np.degrees(np.linalg.norm(off[3:])) < 0.3
    assert fit.automatic and any("half a turn" in text for text in fit.warnings)


def test_a_guess_two_centimetres_and_ten_degrees_off_still_arrives(scene):
    view = scene().look(seed=6)
    guess = small_motion(np.array([0.02, -0.015, 0.01, 0.05, -0.05, 0.17]), TOP) @ view.pose
    fit = fit_camera(view.cloud, SIZE, 0.002, guess)
    assert np.linalg.norm(error(fit, view.pose)[:3]) < 3e-4
    assert any("from [camera] to_phantom" in text for text in fit.warnings)


@pytest.mark.parametrize("bias", [0.0, 3e-4])
def test_camera_covariance_is_calibrated_with_and_without_smooth_sensor_error(scene, bias):
    scores, squares = [], []
    for seed in range(24):
        view = scene(bias=bias, camera=PLACES[seed % 3], pixels=60).look(seed)
        fit = fit_camera(view.cloud, SIZE, 0.002, guessed(view.pose, seed))
        off = error(fit, view.pose)
        scores.append(off / np.sqrt(np.diag(fit.covariance)))
        squares.append(off @ np.linalg.solve(fit.covariance, off) / 6)
    spread = np.sqrt(np.mean(np.square(scores), axis=0))
    assert (spread > 0.35).all() and (spread < 1.6).all()
    assert 0.4 < np.mean(squares) < 1.6


def test_a_flat_top_alone_leaves_sliding_and_turning_open_and_at_the_guess(scene):
    view = scene(camera=(0.0, -0.001, 0.33), bias=0.0).look(seed=8)
    flat = view.cloud[view.pose.apply(view.cloud)[:, 2] > SIZE[2] - 0.003]
    guess = small_motion(np.array([4e-3, -3e-3, 2e-3, 0.01, -0.02, 0.05]), TOP) @ view.pose
    fit = fit_camera(flat, SIZE, 0.002, guess)
    off = fit.phantom_from_camera @ guess.inverse()
    moved = off.apply(TOP) - TOP
    assert np.abs(moved[:2]).max() < 5e-4 and abs(off.rotation_vector[2]) < 0.01
    assert abs(error(fit, view.pose)[2]) < 2e-4
    sentences = " ".join(fit.weak_directions)
    for direction in ("translation along x", "translation along y", "rotation about z"):
        assert direction in sentences
    assert "kept at the first guess" in sentences
    assert np.sqrt(fit.covariance[0, 0]) > 5e-3 and np.sqrt(fit.covariance[2, 2]) < 1e-3


def test_a_view_of_top_and_two_sides_has_no_weak_direction(scene):
    view = scene().look(seed=9)
    fit = fit_camera(view.cloud, SIZE, 0.002, view.pose)
    assert fit.weak_directions == ()
    assert set(fit.face_counts) == {"top", "-x", "-y", "table"}
    assert fit.explained > 0.95 and abs(fit.table_height) < 3e-4


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_block_that_sags_by_a_millimetre_does_not_drag_the_pose_along(scene, seed):
    view = scene(size=(SIZE[0], SIZE[1], SIZE[2] - 1.0e-3), pixels=150).look(seed)
    fit = fit_camera(view.cloud, SIZE, 0.002, guessed(view.pose, seed))
    off = error(fit, view.pose)
    assert np.linalg.norm(off[:3]) < 3e-4
    assert np.degrees(np.linalg.norm(off[3:])) < 0.2
    assert fit.face_offsets["top"] < -5e-4
    assert np.abs(off / np.sqrt(np.diag(fit.covariance))).max() < 4.0


def test_a_block_lower_than_stated_is_said_in_millimetres(scene):
    view = scene(size=(SIZE[0], SIZE[1], SIZE[2] - 2.5e-3)).look(seed=10)
    fit = fit_camera(view.cloud, SIZE, 0.002, view.pose)
    assert any("lower over the table" in text and "mm" in text for text in fit.warnings)


def test_a_cloud_without_table_or_guess_is_refused_with_what_to_do(scene):
    view = scene().look(seed=11)
    points = view.cloud[view.pose.apply(view.cloud)[:, 2] > SIZE[2] - 0.002]
    with pytest.raises(RegistrationError, match="to_phantom"):
        fit_camera(points, SIZE, 0.002)


def test_a_cloud_of_scattered_points_is_refused():
    points = np.random.default_rng(0).uniform(-0.2, 0.2, (500, 3)) + np.array([0.0, 0.0, 0.4])
    with pytest.raises(RegistrationError):
        fit_camera(points, SIZE, 0.002)


def test_a_tiny_cloud_is_refused_with_its_count():
    with pytest.raises(RegistrationError, match="has 10 points"):
        fit_camera(np.zeros((10, 3)), SIZE, 0.002)


def test_the_same_cloud_gives_the_same_pose_twice(scene):
    view = scene().look(seed=12)
    first, second = (
        fit_camera(view.cloud, SIZE, 0.002).phantom_from_camera.matrix for _ in range(2)
    )
    np.testing.assert_allclose(first, second, atol=1e-9)
