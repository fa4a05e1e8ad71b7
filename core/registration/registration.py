"""Registration of a dataset: robot to phantom from touches, and camera to phantom from the rest
cloud, with warnings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.foundation.progress import Report, silent
from palpate.registration.camera.accepted_camera import accepted_camera_fit
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.camera.heading import tool_misfit
from palpate.registration.rest_fit import fit_rest_cloud, refine_rest_cloud
from palpate.registration.robot.landmark_pairing import TouchProposal, propose_pairing
from palpate.registration.robot.landmark_repair import (
    LandmarkRepair,
    choose_repair,
    find_repairs,
    resized_repair,
)
from palpate.registration.robot.robot_fit import RobotFit, fit_robot
from palpate.registration.uncertainty import PRIOR
from palpate.setup.setup import Material, Sensor, Setup, Tool, Touching

__all__ = ["Registration", "register", "setup_from"]

_DECIDED = 3.0e-3
"""Distance of the tool [m] by which one of several poses must fit better to be chosen."""
DOUBTFUL_TOUCHES = 2.0e-3
"""RMS of the touches beyond which a warning is given [m]."""


@dataclass(frozen=True, eq=False)
class Registration:
    """Poses between the frames of a dataset, with covariances.

    A covariance (6, 6) is that of (translation [m], rotation vector [rad]) along the phantom's
    axes, of the small motion about the pivot (3,) [m] that leads from the stated pose to the true
    one: `small_motion(vector, pivot) @ phantom_from_...`.

    Attributes:
        phantom_from_robot: from the touches.
        robot_covariance: (6, 6) of `phantom_from_robot`.
        robot_pivot: (3,) centroid of the touched landmarks [m].
        touch_residuals: (n, 3) [m], phantom frame, moved touch minus landmark.
        touch_rms: root mean square length of the residuals [m].
        phantom_from_camera: from the rest cloud.
        camera_covariance: (6, 6) of `phantom_from_camera`.
        camera_pivot: (3,) centre of the block's top [m].
        weak_directions: sentences about poorly determined directions of the camera's pose.
        warnings: for a person.
        proposal: another pairing or size of the touches that fits better; never applied.
        camera: the camera fit with its statistics; None without a rest cloud or without clouds.
        repair: pairing and size of the touched polygon that the reduction of the measurement uses;
            None where the stated ones are used.
    """

    phantom_from_robot: Transform
    robot_covariance: FloatArray
    robot_pivot: FloatArray
    touch_residuals: FloatArray
    touch_rms: float
    phantom_from_camera: Transform
    camera_covariance: FloatArray
    camera_pivot: FloatArray
    weak_directions: tuple[str, ...]
    warnings: tuple[str, ...]
    proposal: TouchProposal | None
    camera: CameraFit | None
    repair: LandmarkRepair | None = None

    @property
    def repaired(self) -> Registration:
        """The registration with the repaired robot pose, for finding the tool in the clouds."""
        if self.repair is None:
            return self
        fit = self.repair.fit
        return replace(
            self,
            phantom_from_robot=fit.phantom_from_robot,
            robot_covariance=fit.covariance,
            robot_pivot=fit.pivot,
            repair=None,
        )


def register(dataset: Dataset, report: Report = silent) -> Registration:
    """Register robot and camera to the phantom; RegistrationError where that is impossible.

    Camera to phantom is that of the accepted registration, where the dataset has one.
    """
    report(0.0, "robot to phantom from touches")
    robot, proposal = _register_robot(dataset)
    warnings = _touch_warnings(robot, proposal)
    report(0.2, "camera to phantom from the rest cloud")
    camera, repairs = None, _repairs(dataset, proposal)
    repair = repairs[0] if repairs else None
    if dataset.has_rest and dataset.observed:
        camera = _register_camera(dataset)
        report(0.7, "which way round the phantom lies")
        # An automatic heading follows the tool; a given heading decides between repairs.
        if not camera.automatic:
            repair = choose_repair(dataset, repairs, camera.phantom_from_camera)
        camera = _settle_heading(
            dataset, (repair.fit if repair else robot).phantom_from_robot, camera
        )
        warnings += camera.warnings
    report(1.0, "registered")
    return Registration(
        phantom_from_robot=robot.phantom_from_robot,
        robot_covariance=robot.covariance,
        robot_pivot=robot.pivot,
        touch_residuals=robot.residuals,
        touch_rms=robot.rms,
        phantom_from_camera=camera.phantom_from_camera if camera else Transform(),
        camera_covariance=camera.covariance if camera else np.diag(PRIOR**2),
        camera_pivot=camera.pivot if camera else np.array([0.0, 0.0, dataset.geometry.height]),
        weak_directions=camera.weak_directions if camera else (),
        warnings=warnings,
        proposal=proposal,
        camera=camera,
        repair=repair,
    )


def setup_from(dataset: Dataset, registration: Registration) -> Setup:
    """The setup that the experimenter believes in, with the registrations and their touches."""
    config = dataset.config
    misses = tuple((float(x), float(y), float(z)) for x, y, z in registration.touch_residuals)
    return Setup(
        geometry=dataset.geometry,
        tool=Tool(radius=config.tool_radius),
        material=Material(young_modulus=config.young_modulus, poisson_ratio=config.poisson_ratio),
        sensor=Sensor(
            depth_sigma=config.depth_sigma,
            edge=config.edge,
            view=() if registration.camera is None else registration.camera.view,
        ),
        mass=config.mass,
        landmarks=tuple(config.landmarks[name] for name in dataset.touches.names),
        touching=Touching(
            misses=misses,
            lift=config.touch_offset,
            deviation=config.touch_sigma or dataset.touches.deviation,
        ),
        phantom_from_robot=registration.phantom_from_robot,
        phantom_from_camera=registration.phantom_from_camera,
    )


def _register_camera(dataset: Dataset) -> CameraFit:
    """Camera to phantom: as accepted, where a registration was; else from the rest cloud."""
    cloud, config, accepted = dataset.rest_cloud(), dataset.config, dataset.accepted
    if accepted is None:
        return fit_rest_cloud(cloud, dataset.geometry, config.depth_sigma, config.to_phantom)
    start = accepted.phantom_from_camera
    fit = refine_rest_cloud(cloud, dataset.geometry, start, config.depth_sigma)
    return accepted_camera_fit(fit, accepted)


def _register_robot(dataset: Dataset) -> tuple[RobotFit, TouchProposal | None]:
    config, touches = dataset.config, dataset.touches
    lift = np.array([0.0, 0.0, config.touch_offset])
    expected = {name: np.asarray(place) + lift for name, place in config.landmarks.items()}
    robot = fit_robot(touches.positions, np.array([expected[name] for name in touches.names]))
    return robot, propose_pairing(
        touches.names, touches.positions, expected, dataset.geometry, _tool_starts(dataset)
    )


def _repairs(dataset: Dataset, proposal: TouchProposal | None) -> tuple[LandmarkRepair, ...]:
    config, touches = dataset.config, dataset.touches
    lift = np.array([0.0, 0.0, config.touch_offset])
    expected = np.array([np.asarray(config.landmarks[name]) + lift for name in touches.names])
    repairs = find_repairs(touches.positions, expected, dataset.geometry, _tool_starts(dataset))
    if repairs or proposal is None or proposal.scale == 1.0:
        return repairs
    return (resized_repair(touches.positions, expected),)


def _tool_starts(dataset: Dataset) -> FloatArray:
    """First tool position (k, 3) [m] of each sequence, robot frame."""
    return np.array([dataset.sequence(name).kinematics.position[0] for name in dataset.sequences])


def _touch_warnings(robot: RobotFit, proposal: TouchProposal | None) -> tuple[str, ...]:
    warnings: tuple[str, ...] = (proposal.sentence,) if proposal else ()
    if robot.rms > DOUBTFUL_TOUCHES:
        worst = np.linalg.norm(robot.residuals, axis=1)
        warnings += (
            f"The touches miss their landmarks by {robot.rms * 1e3:.1f} mm RMS (at most "
            f"{worst.max() * 1e3:.1f} mm, "
            f"row {worst.argmax() + 1}; under {DOUBTFUL_TOUCHES * 1e3:.0f} mm is expected): "
            "what is found from this registration is doubtful.",
        )
    return warnings


def _doubt_tool(dataset: Dataset, camera: CameraFit, misfit: float) -> CameraFit:
    """Warn where camera and kinematics put the tool in different places."""
    expected = dataset.config.tool_radius + 0.01
    if not misfit > expected:
        return camera
    doubt = (
        f"The camera sees the tool {misfit * 1e3:.0f} mm from where the kinematics put its centre, "
        f"at most {expected * 1e3:.0f} mm is expected: check touches.csv, [camera] to_phantom and "
        "that both clocks agree."
    )
    return replace(camera, warnings=(*camera.warnings, doubt))


def _settle_heading(
    dataset: Dataset, phantom_from_robot: Transform, camera: CameraFit
) -> CameraFit:
    """Choose between poses that fit alike, as a plain block's two headings do, by the tool in the
    clouds.

    A given first guess is not changed; it gets a warning.
    """
    fits = (camera, *camera.alternatives)
    away = tool_misfit(dataset, phantom_from_robot, [fit.phantom_from_camera for fit in fits])
    best = int(np.argmin(away))
    others = np.delete(away, best)
    decided = bool(others.size) and float(others.min() - away[best]) > _DECIDED
    if not camera.automatic:
        if decided and best:
            doubt = (
                f"The camera sees the tool {away[0] * 1e3:.0f} mm from where the kinematics put "
                f"it, and {away[best] * 1e3:.0f} mm with the phantom "
                f"{_turned(camera, fits[best])}: the landmarks in touches.csv or [camera] "
                "to_phantom are off by that."
            )
            return replace(camera, warnings=(*camera.warnings, doubt))
        return _doubt_tool(dataset, camera, float(away[0]))
    if not decided:
        return camera
    settled = tuple(text for text in camera.warnings if text != camera.ambiguity)
    return replace(fits[best], automatic=True, warnings=settled)


def _turned(camera: CameraFit, other: CameraFit) -> str:
    """Words on the turn between two poses of the phantom."""
    motion = other.phantom_from_camera @ camera.phantom_from_camera.inverse()
    angle = float(np.degrees(np.linalg.norm(motion.rotation_vector)))
    return "half a turn about z" if angle > 175.0 else f"turned by {angle:.0f} degrees"
