from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.robot.robot_fit import fit_robot, rigid_fits, similarity

CORNERS = np.array(
    [[0.034, 0.02, 0.036], [0.034, -0.02, 0.036], [-0.034, -0.02, 0.036], [-0.034, 0.02, 0.036]]
)
POSE = Transform.from_vector([0.1, -0.2, 0.3], [0.4, -1.1, 0.7])


def touched(noise: float, seed: int, corners: np.ndarray = CORNERS) -> np.ndarray:
    return POSE.inverse().apply(
        corners + np.random.default_rng(seed).normal(0, noise, corners.shape)
    )


def test_exact_touches_give_the_exact_pose():
    fit = fit_robot(touched(0.0, 0), CORNERS)
    np.testing.assert_allclose(fit.phantom_from_robot.matrix, POSE.matrix, atol=1e-12)
    assert fit.rms < 1e-12


def test_mirrored_touches_never_give_a_reflection():
    solid = np.vstack([CORNERS, [[0.0, 0.0, 0.0]]])
    fit = fit_robot(solid * [1, -1, 1], solid)
    assert np.linalg.det(fit.phantom_from_robot.rotation) == pytest.approx(1.0)
    assert fit.rms > 5e-3


def test_batched_fits_agree_with_single_ones():
    targets = np.stack([CORNERS, CORNERS[[1, 2, 3, 0]], CORNERS[::-1]])
    rotations, translations, rms = rigid_fits(touched(3e-4, 2), targets)
    for k, target in enumerate(targets):
        single = fit_robot(touched(3e-4, 2), target)
        np.testing.assert_allclose(rotations[k], single.phantom_from_robot.rotation, atol=1e-10)
        np.testing.assert_allclose(
            translations[k], single.phantom_from_robot.translation, atol=1e-10
        )
        assert rms[k] == pytest.approx(single.rms)


@pytest.mark.parametrize("noise", [2.5e-4, 1.0e-3])
def test_robot_covariance_is_calibrated_over_many_touches(noise: float):
    scores = []
    for seed in range(300):
        fit = fit_robot(touched(noise, seed), CORNERS)
        off = POSE @ fit.phantom_from_robot.inverse()
        error = np.concatenate([off.apply(fit.pivot) - fit.pivot, off.rotation_vector])
        scores.append(error / np.sqrt(np.diag(fit.covariance)))
    spread = np.std(scores, axis=0)
    assert (spread > 0.7).all() and (spread < 1.35).all()
    assert (np.abs(np.mean(scores, axis=0)) < 0.2).all()


def test_few_touches_that_agree_by_luck_are_not_trusted_beyond_a_tenth_of_a_millimetre():
    assert fit_robot(touched(0.0, 0), CORNERS).sigma >= 1e-4


def test_two_touches_are_refused_with_what_is_needed():
    with pytest.raises(RegistrationError, match="2 touches found, at least 3"):
        fit_robot(CORNERS[:2], CORNERS[:2])


def test_touches_on_one_line_are_refused():
    line = np.array([[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.03, 0.0, 0.0]])
    with pytest.raises(RegistrationError, match="on one line"):
        fit_robot(line, line)


def test_similarity_measures_a_shrunken_polygon_with_its_error():
    shrunk = POSE.inverse().apply(0.88 * CORNERS + np.random.default_rng(3).normal(0, 2e-4, (4, 3)))
    scale, sigma, left = similarity(shrunk, CORNERS)
    assert scale == pytest.approx(0.88, abs=4 * sigma)
    assert 0.0005 < sigma < 0.01
    assert left < 5e-4
