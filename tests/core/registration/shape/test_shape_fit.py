"""Camera to phantom for bodies of any shape, without a first guess."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.shape_registration import Seen, attempt, look
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.shape.shape_fit import fit_shape_camera, refine_shape_camera
from palpate.synthetic.bodies.shape_families import draw_shape

LIVER = draw_shape("liver", 0)


def _turn(fit: CameraFit, seen: Seen) -> float:
    """Angle [degrees] between a fit and the true pose."""
    motion = fit.phantom_from_camera @ seen.pose.inverse()
    return float(np.degrees(np.linalg.norm(motion.rotation_vector)))


@pytest.mark.parametrize("number", [1, 2, 5, 11, 15])
def test_views_with_and_without_a_table_are_registered(number: int) -> None:
    trial = attempt(number, seed=3)
    assert trial.verdict == "right" and trial.error < 1e-3


def test_symmetric_body_is_called_so_and_a_guess_decides() -> None:
    dome = draw_shape("dome", 0)
    seen = look(SeenBody(dome), 2, table=True)
    fit = fit_shape_camera(seen.cloud, dome, seen.noise)
    assert len(fit.alternatives) == 1 and any("looks alike in 2 poses" in w for w in fit.warnings)
    assert sorted(round(_turn(one, seen), -1) for one in (fit, *fit.alternatives)) == [0, 180]
    told = fit_shape_camera(seen.cloud, dome, seen.noise, seen.pose)
    assert _turn(told, seen) < 2.0 and not told.warnings and not told.automatic


def test_covariance_and_statistics_are_those_of_the_view() -> None:
    seen = look(SeenBody(LIVER), 4, table=True)
    fit = refine_shape_camera(seen.cloud, LIVER, seen.pose, seen.noise)
    assert fit.noise == pytest.approx(seen.noise, rel=0.1)
    assert set(fit.face_counts) == {"surface", "table"} and abs(fit.table_height) < 0.2e-3
    assert np.sqrt(np.diag(fit.covariance)[:3]).max() < 0.3e-3
    assert fit.explained > 0.8 and not fit.alternatives


def test_other_body_is_doubted() -> None:
    seen = look(SeenBody(LIVER), 4, table=True)
    other = draw_shape("cylinder", 0)
    fit = fit_shape_camera(seen.cloud, other, seen.noise)
    assert any("lie on its stated surface" in text for text in fit.warnings)


def test_guess_that_is_far_off_is_doubted() -> None:
    seen = look(SeenBody(LIVER), 4, table=True)
    off = Transform(seen.pose.rotation, seen.pose.translation + 0.02)
    fit = fit_shape_camera(seen.cloud, LIVER, seen.noise, off)
    assert _turn(fit, seen) < 0.7
    assert any("check that guess" in text for text in fit.warnings)


def test_view_without_the_body_is_an_error() -> None:
    seen = look(SeenBody(LIVER), 4, table=True)
    floor = seen.cloud[np.abs(seen.pose.apply(seen.cloud)[:, 2]) < 1e-3]
    with pytest.raises(RegistrationError, match="may be the phantom's, at least 50 are needed"):
        fit_shape_camera(floor, LIVER, seen.noise)
    with pytest.raises(RegistrationError, match="has 10 points"):
        fit_shape_camera(seen.cloud[:10], LIVER, seen.noise)
