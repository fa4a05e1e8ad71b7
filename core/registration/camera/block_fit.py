"""Camera to phantom from the rest cloud: coarse ICP, then robust point-to-plane Gauss-Newton on
faces and table.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import EXPLAINED_LEAST, LEAST_POINTS, CameraFit
from palpate.registration.camera.coarse_icp import align_by_icp
from palpate.registration.camera.guess import automatic_guess, half_turn
from palpate.registration.faces import FACES, Assignment, assign, box_distance, camera_planes
from palpate.registration.pose import motion_jacobian, small_motion
from palpate.registration.robust_weights import centred_weights, depth_noise, robust_weights
from palpate.registration.uncertainty import PRIOR, estimate, make_patches

__all__ = ["fit_camera", "nearest_pose", "refine_camera"]

_HALF_TURN = (
    "A plain block looks the same after half a turn: its heading cannot be told from the rest "
    "cloud; give [camera] to_phantom to settle it."
)

_LOST = (
    "[camera] to_phantom puts none of the rest cloud on the phantom, so that the pose was searched "
    "without it: is it the inverse, or of another convention of axes (x right, y down, z forward "
    "is expected)? Correct or remove it."
)


def fit_camera(
    cloud: FloatArray,
    size: tuple[float, float, float],
    depth_sigma: float = 0.002,
    guess: Transform | None = None,
) -> CameraFit:
    """Register a raw rest cloud to a block on its table.

    The fit starts from `guess` and from an automatic guess, and the result that explains more of
    the cloud is returned. Undetermined directions stay at the first guess, get a wide covariance,
    and are named.

    Args:
        cloud: (n, 3) [m], camera frame.
        size: of the block [m].
        depth_sigma: stated accuracy of depth [m].
        guess: phantom_from_camera; None without.

    Raises:
        RegistrationError: for too few points, or without any first guess.
    """
    if len(cloud) < LEAST_POINTS:
        raise RegistrationError(
            f"the rest cloud has {len(cloud)} points, at least {LEAST_POINTS} are needed",
            points=len(cloud),
        )
    gate = max(2.0 * depth_sigma, 3.0e-3)
    poses = []
    failure = None
    lost = ""
    if guess is not None:
        try:
            poses.append(_refine(cloud, size, align_by_icp(cloud, size, guess), guess, gate))
        except RegistrationError as error:
            failure, guess, lost = error, None, _LOST
    try:
        start = automatic_guess(cloud, size, depth_sigma)
        starts = sorted((start, half_turn() @ start), key=lambda pose: _preference(pose, guess))
        poses.append(_refine(cloud, size, starts[0], guess or starts[0], gate))
    except RegistrationError as error:
        failure = error
    if not poses:
        raise failure or RegistrationError(
            "no first guess of camera to phantom: give [camera] to_phantom"
        )
    shares = [_explained(cloud, size, pose, depth_sigma) for pose in poses]
    # The given guess wins ties: it holds the heading and the undetermined directions.
    best = 1 if len(poses) == 2 and shares[1] > shares[0] + 0.05 else 0
    automatic = guess is None or best == 1
    fit = _conclude(cloud, size, poses[best], shares[best], gate, guess, automatic=automatic)
    return replace(fit, warnings=(lost, *fit.warnings)) if lost else fit


def refine_camera(
    cloud: FloatArray,
    size: tuple[float, float, float],
    start: Transform,
    depth_sigma: float = 0.002,
) -> CameraFit:
    """Register a raw rest cloud from `start` (phantom_from_camera) alone, without a search.

    Args and errors are those of `fit_camera`.
    """
    if len(cloud) < LEAST_POINTS:
        raise RegistrationError(
            f"the rest cloud has {len(cloud)} points, at least {LEAST_POINTS} are needed",
            points=len(cloud),
        )
    gate = max(2.0 * depth_sigma, 3.0e-3)
    pose = _refine(cloud, size, align_by_icp(cloud, size, start), start, gate)
    return _conclude(
        cloud, size, pose, _explained(cloud, size, pose, depth_sigma), gate, pose, automatic=False
    )


def nearest_pose(
    cloud: FloatArray,
    size: tuple[float, float, float],
    start: Transform,
    depth_sigma: float = 0.002,
) -> Transform:
    """Find the pose next to `start` in which a raw cloud shows a block, without its uncertainty.

    Args and errors are those of `fit_camera`.
    """
    gate = max(2.0 * depth_sigma, 3.0e-3)
    return _refine(cloud, size, align_by_icp(cloud, size, start), start, gate)


def _preference(pose: Transform, guess: Transform | None) -> float:
    """Sort key of headings: smallest for the one nearest to the guess; without a guess, for the
    camera on the -y side.
    """
    if guess is None:
        return float(pose.translation[1])
    return float(-np.trace(pose.rotation @ guess.rotation.T))


def _pivot(size: tuple[float, float, float]) -> FloatArray:
    return np.array([0.0, 0.0, size[2]])


def _refine(
    cloud: FloatArray,
    size: tuple[float, float, float],
    pose: Transform,
    guess: Transform,
    gate: float,
) -> Transform:
    """Refine a pose by Gauss-Newton on signed distances to the planes.

    Residuals are scaled by slant, with Huber weights first and Tukey weights at the end. A wide
    prior about `guess` matters only in directions that no plane determines.
    """
    pivot = _pivot(size)
    for step in range(30):
        found = assign(
            pose.apply(cloud),
            camera_planes(size, pose.translation),
            pose.translation,
            gate * (3.0 if step < 5 else 1.0),
        )
        if len(found.rows) < LEAST_POINTS:
            raise RegistrationError(
                f"{len(found.rows)} of {len(cloud)} points of the rest cloud lie on the phantom's "
                "faces or the table, "
                f"at least {LEAST_POINTS} are needed: check [phantom] size and [camera] to_phantom"
            )
        noise = depth_noise(found.distance, found.slant)
        weights = robust_weights(found.distance, found.slant, noise, tukey=step >= 8)
        jacobian = np.einsum("ki,kij->kj", found.normals, motion_jacobian(found.points, pivot))
        weighted = jacobian * (weights / (noise * found.slant) ** 2)[:, None]
        drift = pose @ guess.inverse()
        pull = np.concatenate([drift.apply(pivot) - pivot, drift.rotation_vector]) / PRIOR**2
        step_vector = -np.linalg.solve(
            weighted.T @ jacobian + np.diag(1 / PRIOR**2), weighted.T @ found.distance + pull
        )
        pose = small_motion(step_vector, pivot) @ pose
        if (
            step > 10
            and np.abs(step_vector[:3]).max() < 1e-7
            and np.abs(step_vector[3:]).max() < 1e-6
        ):
            break
    return pose


def _explained(
    cloud: FloatArray, size: tuple[float, float, float], pose: Transform, depth_sigma: float
) -> float:
    """Share of points above the table and near the block that lie on its surface [1]."""
    points = pose.apply(cloud)
    distance = box_distance(points, size)
    near = (points[:, 2] > 3.0e-3) & (distance < 0.02)
    return (
        float((np.abs(distance[near]) < max(1.5 * depth_sigma, 2.0e-3)).mean())
        if near.any()
        else 0.0
    )


def _conclude(
    cloud: FloatArray,
    size: tuple[float, float, float],
    pose: Transform,
    share: float,
    gate: float,
    guess: Transform | None,
    *,
    automatic: bool,
) -> CameraFit:
    """Take a last step with the correlated noise model; compute covariance and warnings."""
    pivot = _pivot(size)
    # Twice: a sagging block shifts the first pose, and with it the choice of points.
    for _ in range(2):
        found, weights = _weighted(cloud, size, pose, gate)
        patches = make_patches(found, weights, pose.translation, pivot)
        last = estimate(patches)
        pose = small_motion(last.motion, pivot) @ pose
    found, weights = _weighted(cloud, size, pose, gate)
    fit = CameraFit.of(
        pose, last, found, weights, FACES, pivot=pivot, lever=float(np.linalg.norm(size)) / 2
    )
    return replace(
        fit,
        noise=patches.noise,
        explained=share,
        automatic=automatic,
        warnings=tuple(_doubts(share, pose, guess, pivot, fit.face_offsets, last.bias)),
        ambiguity=_HALF_TURN if guess is None else "",
    )


def _weighted(
    cloud: FloatArray, size: tuple[float, float, float], pose: Transform, gate: float
) -> tuple[Assignment, FloatArray]:
    """Points on planes, and their robust weights (k,)."""
    found = assign(pose.apply(cloud), camera_planes(size, pose.translation), pose.translation, gate)
    return found, centred_weights(found.face, found.distance, found.slant)


def _doubts(
    share: float,
    pose: Transform,
    guess: Transform | None,
    pivot: FloatArray,
    offsets: dict[str, float],
    bias: float,
) -> list[str]:
    doubts = []
    if share < EXPLAINED_LEAST:
        doubts.append(
            f"Only {share:.0%} of the rest cloud's points near the block lie on its stated surface "
            f"(expected over {EXPLAINED_LEAST:.0%}): check [phantom] size and [camera] to_phantom."
        )
    if guess is None:
        doubts.append(_HALF_TURN)
    else:
        drift = guess @ pose.inverse()
        shift, turn = (
            float(np.linalg.norm(drift.apply(pivot) - pivot)),
            float(np.linalg.norm(drift.rotation_vector)),
        )
        if shift > 0.015 or turn > np.radians(8.0):
            doubts.append(
                f"The fit lies {shift * 1e3:.1f} mm and {np.degrees(turn):.1f} degrees from "
                "[camera] to_phantom: check that guess."
            )
    if (
        "top" in offsets
        and "table" in offsets
        and abs(offsets["top"] - offsets["table"]) > max(6.0e-4, 2 * bias)
    ):
        doubts.append(
            f"The top lies {abs(offsets['top'] - offsets['table']) * 1e3:.1f} mm "
            f"{'higher' if offsets['top'] > offsets['table'] else 'lower'} over the table than "
            "[phantom] size says: "
            "it sags under its weight, has another size, or something lies under it."
        )
    return doubts
