"""Poses of robot and camera that fit alike: the tool in the clouds decides between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.dataset import Dataset
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import CameraFit
from palpate.registration.camera.heading import tool_misfit
from palpate.registration.robot.landmark_repair import LandmarkRepair
from palpate.registration.robot.robot_fit import RobotFit

__all__ = ["settled_poses"]

_DECIDED = 3.0e-3
"""Distance of the tool [m] by which one of several poses must fit better to be chosen."""


def settled_poses(
    dataset: Dataset, robot: RobotFit, camera: CameraFit, repair: LandmarkRepair | None
) -> tuple[RobotFit, CameraFit]:
    """Choose among the alternatives of both registrations those that put the tool where the camera
    sees it, with warnings where it is seen elsewhere.

    Args:
        dataset: whose clouds show the tool.
        robot: with its alternatives.
        camera: with its alternatives.
        repair: of the touches' pairing; its pose is used in place of the robot's.
    """
    robot = _settled_robot(dataset, robot, camera) if robot.alternatives else robot
    fit = repair.fit if repair else robot
    return robot, _settled_heading(dataset, fit.phantom_from_robot, camera)


def _settled_robot(dataset: Dataset, robot: RobotFit, camera: CameraFit) -> RobotFit:
    """The alternative of the robot's pose that agrees with any pose of the camera that is possible.

    Where none is clearly better, the leading one stays, with its alternatives.
    """
    cameras = (camera, *(camera.alternatives if camera.automatic else ()))
    poses = [one.phantom_from_camera for one in cameras]
    fits = (robot, *robot.alternatives)
    away = np.array(
        [float(np.min(tool_misfit(dataset, one.phantom_from_robot, poses))) for one in fits]
    )
    best = int(np.argmin(away))
    if not float(np.delete(away, best).min() - away[best]) > _DECIDED:
        return robot
    return replace(fits[best], alternatives=())


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


def _settled_heading(
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
