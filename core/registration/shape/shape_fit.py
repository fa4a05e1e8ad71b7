"""Camera to phantom for a body of any shape, from the rest cloud."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial import ConvexHull

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.camera_fit import EXPLAINED_LEAST, LEAST_POINTS, CameraFit
from palpate.registration.camera.table_plane import TablePlane, find_table
from palpate.registration.pose import small_motion
from palpate.registration.shape.pose_search import Hypothesis, distinct, find_poses, improved
from palpate.registration.shape.ray_fit import PARTS, refined, weighted
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.shape.seen_rays import SeenRays
from palpate.registration.uncertainty import Patches, PoseEstimate, estimate, make_patches
from palpate.setup.phantom_geometry import Geometry

__all__ = ["fit_shape_camera", "nearest_shape_pose", "refine_shape_camera", "settled_pose"]

_POOR = 1.3
"""Misfit of depth from which on the plane that was found may be no table [variances]."""
_FAR = 15e-3
"""Distance of the fit from a guess beyond which a warning is given [m]."""
_LARGER = 1.1
"""Least extent of a table over the body's [1]."""
_ALIKE = 6.0
"""Difference of log likelihood below which two poses fit alike [nats]."""


def fit_shape_camera(
    cloud: FloatArray,
    geometry: Geometry,
    depth_sigma: float = 0.002,
    guess: Transform | None = None,
) -> CameraFit:
    """Register a raw rest cloud to a body, on its table where one is seen.

    All poses are searched. Those that fit about as well as the best are its `alternatives`; of
    these a guess decides.

    Args:
        cloud: (n, 3) [m], camera frame.
        geometry: of the body.
        depth_sigma: stated accuracy of depth [m].
        guess: phantom_from_camera; None without.

    Raises RegistrationError for too few points, or where nothing looks like the body.
    """
    if len(cloud) < LEAST_POINTS:
        raise RegistrationError(
            f"the rest cloud has {len(cloud)} points, at least {LEAST_POINTS} are needed",
            points=len(cloud),
        )
    body = SeenBody(geometry)
    view, found = _searched(cloud, body, depth_sigma, guess)
    fits = _all_fitted(cloud, body, depth_sigma, view, found)
    alike = [fit for fit, score in fits if score > fits[0][1] - _ALIKE]
    if guess is not None:
        alike.sort(key=lambda fit: _away(fit.phantom_from_camera, guess, body))
    return _with_doubts(alike[0], alike[1:], guess, body)


def refine_shape_camera(
    cloud: FloatArray, geometry: Geometry, start: Transform, depth_sigma: float = 0.002
) -> CameraFit:
    """Register a raw rest cloud from `start` (phantom_from_camera) alone, without a search.

    Args and errors are those of `fit_shape_camera`.
    """
    body = SeenBody(geometry)
    table = _table(cloud, body, depth_sigma)
    view = SeenRays.of(cloud, body, depth_sigma, table)
    pose = improved(view, body, start @ view.to_camera) @ view.from_camera
    return _fitted(cloud, body, pose, depth_sigma, view)


def nearest_shape_pose(
    cloud: FloatArray, geometry: Geometry, start: Transform, depth_sigma: float = 0.002
) -> Transform:
    """Find the pose next to `start` in which a raw cloud shows a body, without its uncertainty.

    Args and errors are those of `fit_shape_camera`.
    """
    body = SeenBody(geometry)
    view = SeenRays.of(cloud, body, depth_sigma, _table(cloud, body, depth_sigma))
    return improved(view, body, start @ view.to_camera) @ view.from_camera


def _table(cloud: FloatArray, body: SeenBody, depth_sigma: float) -> TablePlane | None:
    """Return the table; None where no plane is larger than the body."""
    thickness = max(depth_sigma, 1.0e-3)
    try:
        table = find_table(cloud, thickness)
    except RegistrationError:
        return None
    plane = cloud[np.abs(table.height(cloud)) < thickness]
    low, high = np.percentile(plane, [2, 98], axis=0)
    return table if np.linalg.norm(high - low) > _LARGER * 2 * body.reach else None


def _searched(
    cloud: FloatArray, body: SeenBody, depth_sigma: float, guess: Transform | None
) -> tuple[SeenRays, list[Hypothesis]]:
    """Return the view, with the table or without it, that a pose explains better, and its poses."""
    tried, failure = list[tuple[SeenRays, list[Hypothesis]]](), None
    for table in dict.fromkeys((_table(cloud, body, depth_sigma), None)):
        if tried and tried[0][1][0].misfit < _POOR:
            break
        try:
            view = SeenRays.of(cloud, body, depth_sigma, table)
        except RegistrationError as error:
            failure = error
            continue
        found = find_poses(view, body)
        if guess is not None:
            pose = improved(view, body, guess @ view.to_camera)
            given = Hypothesis(pose, view.misfit(body, pose))
            found = distinct([*found, given], body)
        tried.append((view, found))
    if not tried:
        raise failure or RegistrationError("no point of the rest cloud may be the phantom's")
    return min(tried, key=lambda one: one[1][0].misfit)


def _all_fitted(
    cloud: FloatArray, body: SeenBody, depth_sigma: float, view: SeenRays, found: list[Hypothesis]
) -> list[tuple[CameraFit, float]]:
    """Return the refined poses that differ, with their log likelihoods [nats], best first."""
    fits = []
    for one in found:
        try:
            fit = _fitted(cloud, body, one.pose @ view.from_camera, depth_sigma, view)
        except RegistrationError as error:
            failure = error
            continue
        pose = fit.phantom_from_camera @ view.to_camera
        fits.append((fit, pose, view.log_likelihood(body, pose)))
    if not fits:
        raise failure
    fits.sort(key=lambda one: -one[2])
    kept = distinct([Hypothesis(pose, -score) for _, pose, score in fits], body)
    poses = {id(one.pose) for one in kept}
    return [(fit, score) for fit, pose, score in fits if id(pose) in poses]


def _fitted(
    cloud: FloatArray, body: SeenBody, pose: Transform, depth_sigma: float, view: SeenRays
) -> CameraFit:
    """Refine a pose along rays, with covariance and statistics."""
    gate, pivot, table = _gate(depth_sigma), body.middle, view.table
    pose, last, patches = _settled(cloud, body, pose, gate, table=table)
    found, weights = weighted(cloud, body, pose, gate, table=table)
    fit = CameraFit.of(pose, last, found, weights, PARTS, pivot=pivot, lever=body.reach)
    explained = view.explained(body, pose @ view.to_camera)
    return replace(fit, noise=patches.noise, explained=explained, view=_seen_part(cloud))


def _seen_part(cloud: FloatArray) -> tuple[tuple[float, float], ...]:
    """Corners (x/z, y/z) of the convex part of the image in which a cloud (n, 3) [m] lies."""
    image = cloud[:, :2] / cloud[:, 2:]
    return tuple((float(u), float(v)) for u, v in image[ConvexHull(image).vertices])


def settled_pose(
    cloud: FloatArray, body: SeenBody, start: Transform, depth_sigma: float, *, table: bool
) -> Transform:
    """Refine a pose that is nearly right: the last step of a registration, without a covariance.

    Args:
        cloud: (n, 3) [m], camera frame.
        body: as stated.
        start: phantom_from_camera.
        depth_sigma: stated accuracy of depth [m].
        table: whether the body stands on a table in z = 0.
    """
    return _settled(cloud, body, start, _gate(depth_sigma), table=table)[0]


def _gate(depth_sigma: float) -> float:
    """Largest error [m] along the normal of a point of the phantom."""
    return max(2.0 * depth_sigma, 3.0e-3)


def _settled(
    cloud: FloatArray, body: SeenBody, pose: Transform, gate: float, *, table: bool
) -> tuple[Transform, PoseEstimate, Patches]:
    """Refine a pose along rays, then by averages that share a smooth error of the camera."""
    pivot = body.middle
    pose = refined(cloud, body, pose, gate, table=table)
    for _ in range(2):
        found, weights = weighted(cloud, body, pose, gate, table=table)
        patches = make_patches(found, weights, pose.translation, pivot)
        last = estimate(patches)
        # Along weak directions the outline knows more than the points on the surface do.
        pose = small_motion(last.settled(body.reach), pivot) @ pose
    return pose, last, patches


def _away(pose: Transform, other: Transform, body: SeenBody) -> float:
    """Distance [m] between two poses, turns counted at the body's rim."""
    motion = pose @ other.inverse()
    shift = np.linalg.norm(motion.apply(body.middle[None])[0] - body.middle)
    return float(shift + body.reach * np.linalg.norm(motion.rotation_vector))


def _with_doubts(
    best: CameraFit, others: list[CameraFit], guess: Transform | None, body: SeenBody
) -> CameraFit:
    doubts, ambiguity = [], ""
    if best.explained < EXPLAINED_LEAST:
        doubts.append(
            f"Only {best.explained:.0%} of the rest cloud's points that may be the phantom's lie "
            f"on its stated surface (expected over {EXPLAINED_LEAST:.0%}): check [phantom] surface "
            "and its unit, and [camera] to_phantom."
        )
    if others and guess is None:
        ambiguity = (
            f"The phantom looks alike in {len(others) + 1} poses: which one is right cannot be "
            "told from the rest cloud; give [camera] to_phantom, or register by clicks."
        )
        doubts.append(ambiguity)
    if guess is not None and (away := _away(best.phantom_from_camera, guess, body)) > _FAR:
        doubts.append(
            f"The fit lies {away * 1e3:.1f} mm from [camera] to_phantom, turns counted at the "
            "phantom's rim: check that guess."
        )
    return replace(
        best,
        automatic=guess is None,
        warnings=tuple(doubts),
        ambiguity=ambiguity,
        alternatives=tuple(others),
    )
