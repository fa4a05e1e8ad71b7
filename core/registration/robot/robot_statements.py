"""The statements of a dataset that relate robot and phantom, each as a fit; one leads, the others
check it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2

from palpate.dataset import Dataset
from palpate.dataset.statements.stated_pose import StatedPose
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.pose import motion_jacobian
from palpate.registration.robot.robot_fit import RobotFit, fit_robot
from palpate.registration.robot.trace_fit import fit_traces

__all__ = ["disagreements", "from_hand_eye", "robot_fits", "touched_centres"]

_SURELY = float(chi2.ppf(0.999, 6))
"""Squared distance of two poses [variances] that chance exceeds once in a thousand."""


def touched_centres(dataset: Dataset) -> dict[str, FloatArray]:
    """Tool centre (3,) [m] that each landmark expects of a touch, by name, phantom frame."""
    config = dataset.config
    if not config.ball_touches:
        lift = np.array([0.0, 0.0, config.touch_offset])
        return {name: np.asarray(place) + lift for name, place in config.landmarks.items()}
    places = np.array(list(config.landmarks.values())).reshape(-1, 3)
    normals = dataset.geometry.facing(places)[1] if len(places) else places
    centres = places + config.tool_radius * normals
    return dict(zip(config.landmarks, centres, strict=True))


def robot_fits(dataset: Dataset) -> tuple[RobotFit, ...]:
    """Fits of all statements that need no camera, the leading one first: touches, traces, and a
    matrix.

    Raises RegistrationError where the leading one cannot be fitted.
    """
    fits: list[RobotFit] = []
    touches, matrix = dataset.touches, dataset.config.phantom_from_robot
    if touches.names:
        expected = touched_centres(dataset)
        centres = np.array([expected[name] for name in touches.names])
        fits.append(fit_robot(touches.positions, centres))
    stated = [] if matrix is None else [_of_matrix(dataset, matrix)]
    if len(dataset.traces):
        fits.append(_of_traces(dataset, [one.phantom_from_robot for one in (*fits, *stated)]))
    return (*fits, *stated)


def _of_traces(dataset: Dataset, guesses: Sequence[Transform]) -> RobotFit:
    """Fit the traces from the other statements on; by a search where these lead nowhere."""
    points, geometry = dataset.traces.positions, dataset.geometry
    radius = dataset.config.tool_radius
    if guesses:
        try:
            return fit_traces(points, geometry, radius, guesses)
        except RegistrationError:
            pass
    return fit_traces(points, geometry, radius)


def _of_matrix(dataset: Dataset, stated: StatedPose) -> RobotFit:
    """A stated matrix as a fit; an error of its rotation turns about the robot's origin."""
    middle = _middle(dataset)
    millimetres, degrees = 1e3 * stated.position_sigma, np.degrees(stated.rotation_sigma)
    return RobotFit(
        phantom_from_robot=stated.pose,
        residuals=np.zeros((0, 3)),
        rms=0.0,
        sigma=stated.position_sigma,
        pivot=middle,
        covariance=_about(stated.pose.translation, stated.covariance, middle),
        source="[robot] phantom_from_robot",
        summary=f"robot to phantom as stated, within {millimetres:.3g} mm and {degrees:.2g} "
        "degrees",
    )


def from_hand_eye(dataset: Dataset, camera: CameraFit) -> RobotFit | None:
    """Robot to phantom by the camera's registration and the hand-eye calibration; None without
    one.
    """
    stated = dataset.config.robot_from_camera
    if stated is None:
        return None
    pose = camera.phantom_from_camera @ stated.pose.inverse()
    # A calibration error turns about the camera: its translation is that of the camera's origin.
    turned = pose.rotation
    turn = np.block([[turned, np.zeros((3, 3))], [np.zeros((3, 3)), turned]])
    own = turn @ stated.covariance @ turn.T
    middle = _middle(dataset)
    about_camera = _about(camera.phantom_from_camera.translation, own, middle)
    covariance = about_camera + _about(camera.pivot, camera.covariance, middle)
    return RobotFit(
        phantom_from_robot=pose,
        residuals=np.zeros((0, 3)),
        rms=0.0,
        sigma=stated.position_sigma,
        pivot=middle,
        covariance=covariance,
        source="[camera] robot_from_camera",
        summary="robot to phantom by the camera and its hand-eye calibration",
    )


def _middle(dataset: Dataset) -> FloatArray:
    """Middle of the phantom's bounds (3,) [m]."""
    return np.asarray(0.5 * (dataset.geometry.low + dataset.geometry.high))


def _about(pivot: FloatArray, covariance: FloatArray, other: FloatArray) -> FloatArray:
    """Covariance (6, 6) of a motion about another pivot (3,) [m]."""
    there = np.vstack([motion_jacobian(other[None], pivot)[0], np.eye(6)[3:]])
    return np.asarray(there @ covariance @ there.T)


def disagreements(leading: RobotFit, others: Sequence[RobotFit]) -> tuple[str, ...]:
    """Sentences about statements that contradict the leading one beyond their accuracies."""
    found = []
    for other in others:
        motion, covariance = leading.apart(other)
        if float(motion @ np.linalg.solve(covariance, motion)) < _SURELY:
            continue
        spread = np.sqrt(np.diag(covariance))
        along = "xyz"[int(np.abs(motion[:3]).argmax())]
        about = "xyz"[int(np.abs(motion[3:]).argmax())]
        found.append(
            f"{other.source} puts the robot {1e3 * np.linalg.norm(motion[:3]):.1f} mm from where "
            f"{leading.source} puts it, mainly along {along}, and turned by "
            f"{np.degrees(np.linalg.norm(motion[3:])):.1f} degrees, mainly about {about} (they are "
            f"stated to agree within {1e3 * np.linalg.norm(spread[:3]):.1f} mm and "
            f"{np.degrees(np.linalg.norm(spread[3:])):.1f} degrees): one of them is off. "
            f"{leading.source} is used."
        )
    return tuple(found)
