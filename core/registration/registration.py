"""Registration of a dataset: robot to phantom from touches, traces or stated poses, and camera to
phantom from the rest cloud, with warnings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.foundation.progress import Report, silent
from palpate.registration.camera.accepted_camera import accepted_camera_fit
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.rest_fit import fit_rest_cloud, refine_rest_cloud
from palpate.registration.robot.landmark_pairing import TouchProposal, propose_pairing
from palpate.registration.robot.landmark_repair import (
    LandmarkRepair,
    choose_repair,
    find_repairs,
    resized_repair,
)
from palpate.registration.robot.robot_fit import RobotFit
from palpate.registration.robot.robot_statements import (
    disagreements,
    from_hand_eye,
    robot_fits,
    touched_centres,
)
from palpate.registration.settled_poses import settled_poses
from palpate.registration.uncertainty import PRIOR
from palpate.setup.setup import Material, Sensor, Setup, Tool, Touching, Tracing

__all__ = ["Registration", "register", "setup_from", "unregistered_setup"]

_WEAK = 1.0e-3
"""Standard deviation of the robot's pose beyond which a warning is given [m]."""
DOUBTFUL_TRACES = 0.6e-3
"""RMS gap of the traced points on the surface beyond which a warning is given [m]: a cast differs
from its drawing by some 0.3 mm."""
DOUBTFUL_TOUCHES = 2.0e-3
"""RMS of the touches beyond which a warning is given [m]."""


@dataclass(frozen=True, eq=False)
class Registration:
    """Poses between the frames of a dataset, with covariances.

    A covariance (6, 6) is that of (translation [m], rotation vector [rad]) along the phantom's
    axes, of the small motion about the pivot (3,) [m] that leads from the stated pose to the true
    one: `small_motion(vector, pivot) @ phantom_from_...`.

    Attributes:
        phantom_from_robot: from touches, traces or stated poses.
        robot_covariance: (6, 6) of `phantom_from_robot`.
        robot_pivot: (3,) centroid of the touched landmarks, or middle of the phantom [m].
        touch_residuals: (n, 3) [m], phantom frame, moved touch minus landmark; empty without
            touches.
        touch_rms: root mean square length of the residuals, or of the gaps of traced points [m].
        phantom_from_camera: from the rest cloud.
        camera_covariance: (6, 6) of `phantom_from_camera`.
        camera_pivot: (3,) centre of the block's top [m].
        weak_directions: sentences about poorly determined directions of the camera's pose.
        warnings: for a person.
        proposal: another pairing or size of the touches that fits better; never applied.
        camera: the camera fit with its statistics; None without a rest cloud or without clouds.
        repair: pairing and size of the touched polygon that the reduction of the measurement uses;
            None where the stated ones are used.
        robot: the fit of the robot that leads.
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
    robot: RobotFit | None = None

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
    report(0.0, "robot to phantom")
    fits = robot_fits(dataset)
    proposal = _proposal(dataset)
    report(0.2, "camera to phantom from the rest cloud")
    camera, repairs = None, _repairs(dataset, proposal)
    repair = repairs[0] if repairs else None
    warnings: tuple[str, ...] = ()
    if dataset.has_rest and dataset.observed:
        camera = _register_camera(dataset, fits)
        hand_eye = from_hand_eye(dataset, camera)
        fits = fits if hand_eye is None else (*fits, hand_eye)
        robot = _leading(fits)
        report(0.7, "which way round the phantom lies")
        # An automatic heading follows the tool; a given heading decides between repairs.
        if not camera.automatic:
            repair = choose_repair(dataset, repairs, camera.phantom_from_camera)
        robot, camera = settled_poses(dataset, robot, camera, repair)
        warnings = camera.warnings
    robot = robot if camera else _leading(fits)
    warnings = (*_robot_warnings(robot, proposal), *disagreements(robot, fits[1:]), *warnings)
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
        robot=robot,
    )


def unregistered_setup(dataset: Dataset) -> Setup:
    """The setup that the experimenter believes in without poses: phantom, tool and landmarks."""
    config = dataset.config
    return Setup(
        geometry=dataset.geometry,
        tool=Tool(radius=config.tool_radius),
        material=Material(young_modulus=config.young_modulus, poisson_ratio=config.poisson_ratio),
        sensor=Sensor(depth_sigma=config.depth_sigma, edge=config.edge),
        mass=config.mass,
        landmarks=tuple(config.landmarks[name] for name in dataset.touches.names),
    )


def setup_from(dataset: Dataset, registration: Registration) -> Setup:
    """The setup that the experimenter believes in, with the registrations and their touches."""
    config, stated = dataset.config, unregistered_setup(dataset)
    touched = [np.asarray(config.landmarks[name]) for name in dataset.touches.names]
    lifts = [touched_centres(dataset)[name] for name in dataset.touches.names]
    radius = config.tool_radius
    normals = (np.array(lifts) - touched) / radius if config.ball_touches and touched else ()
    traced = np.zeros((0, 3)) if registration.robot is None else registration.robot.traced
    return replace(
        stated,
        sensor=replace(
            stated.sensor, view=() if registration.camera is None else registration.camera.view
        ),
        touching=Touching(
            misses=_rows(registration.touch_residuals),
            lift=radius if config.ball_touches else config.touch_offset,
            normals=_rows(normals),
            deviation=config.touch_sigma or dataset.touches.deviation,
        ),
        tracing=None if not len(traced) else Tracing(centres=_rows(traced), radius=radius),
        phantom_from_robot=registration.phantom_from_robot,
        phantom_from_camera=registration.phantom_from_camera,
    )


def _register_camera(dataset: Dataset, fits: Sequence[RobotFit]) -> CameraFit:
    """Camera to phantom: as accepted, where a registration was; else from the rest cloud.

    A hand-eye calibration gives a first guess where none is stated.
    """
    cloud, config, accepted = dataset.rest_cloud(), dataset.config, dataset.accepted
    if accepted is None:
        guess, hand_eye = config.to_phantom, config.robot_from_camera
        if guess is None and hand_eye is not None and fits and not fits[0].alternatives:
            guess = fits[0].phantom_from_robot @ hand_eye.pose
        return fit_rest_cloud(cloud, dataset.geometry, config.depth_sigma, guess)
    start = accepted.phantom_from_camera
    fit = refine_rest_cloud(cloud, dataset.geometry, start, config.depth_sigma)
    return accepted_camera_fit(fit, accepted)


def _leading(fits: Sequence[RobotFit]) -> RobotFit:
    """The fit that the registration uses."""
    if not fits:
        raise RegistrationError(
            "nothing relates the robot to the phantom: [camera] robot_from_camera needs clouds; "
            "add touches.csv, traces.csv or [robot] phantom_from_robot",
            file="dataset.toml",
        )
    return fits[0]


def _proposal(dataset: Dataset) -> TouchProposal | None:
    """Another pairing or size of the touches that fits better; None without touches."""
    touches = dataset.touches
    if not touches.names:
        return None
    return propose_pairing(
        touches.names,
        touches.positions,
        touched_centres(dataset),
        dataset.geometry,
        _tool_starts(dataset),
    )


def _repairs(dataset: Dataset, proposal: TouchProposal | None) -> tuple[LandmarkRepair, ...]:
    touches, centres = dataset.touches, touched_centres(dataset)
    if not touches.names:
        return ()
    expected = np.array([centres[name] for name in touches.names])
    repairs = find_repairs(touches.positions, expected, dataset.geometry, _tool_starts(dataset))
    if repairs or proposal is None or proposal.scale == 1.0:
        return repairs
    return (resized_repair(touches.positions, expected),)


def _tool_starts(dataset: Dataset) -> FloatArray:
    """First tool position (k, 3) [m] of each sequence, robot frame."""
    return np.array([dataset.sequence(name).kinematics.position[0] for name in dataset.sequences])


def _robot_warnings(robot: RobotFit, proposal: TouchProposal | None) -> tuple[str, ...]:
    warnings: tuple[str, ...] = (proposal.sentence,) if proposal else ()
    if len(robot.residuals) and robot.rms > DOUBTFUL_TOUCHES:
        worst = np.linalg.norm(robot.residuals, axis=1)
        warnings += (
            f"The touches miss their landmarks by {robot.rms * 1e3:.1f} mm RMS (at most "
            f"{worst.max() * 1e3:.1f} mm, "
            f"row {worst.argmax() + 1}; under {DOUBTFUL_TOUCHES * 1e3:.0f} mm is expected): "
            "what is found from this registration is doubtful.",
        )
    if robot.alternatives:
        warnings += (
            f"{robot.source}: the points fit the phantom in {len(robot.alternatives) + 1} poses "
            "alike; the first is used: trace more of the surface, touch landmarks, or state "
            "[robot] phantom_from_robot.",
        )
    if len(robot.traced) and robot.rms > DOUBTFUL_TRACES:
        warnings += (
            f"The traced points lie {robot.rms * 1e3:.1f} mm RMS off the stated surface (under "
            f"{DOUBTFUL_TRACES * 1e3:.1f} mm is expected): check [phantom] surface, its unit and "
            "[tool] radius.",
        )
    spread = np.sqrt(np.diag(robot.covariance))
    if len(robot.traced) and (off := float(spread[:3].max())) > _WEAK:
        warnings += (
            f"{robot.source} determines the robot's place along {'xyz'[int(spread[:3].argmax())]} "
            f"within {1e3 * off:.1f} mm only: trace more of the surface.",
        )
    return warnings


def _rows(places: FloatArray | Sequence[FloatArray]) -> tuple[tuple[float, float, float], ...]:
    """Rows (n, 3) as tuples."""
    return tuple((float(x), float(y), float(z)) for x, y, z in places)
