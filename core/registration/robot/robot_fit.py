"""Robot to phantom from touched landmarks: the closed-form rigid fit of Kabsch (1976) with
Umeyama's sign (1991).
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.pose import motion_jacobian

__all__ = ["FLOOR", "RobotFit", "fit_robot", "rigid_fits", "similarity"]

FLOOR = 1.0e-4
"""Least standard error of a touch [m]."""
USUAL, USUAL_WORTH = 3.0e-4, 2.0
"""Usual error of a careful touch [m] and its weight in residuals: the inverse gamma prior of the
variance, whose posterior mean is used. Four touches leave six degrees of freedom and may agree by
chance."""


@dataclass(frozen=True, eq=False)
class RobotFit:
    """Robot to phantom.

    Attributes:
        phantom_from_robot: the fit.
        residuals: (n, 3) [m], phantom frame, touch moved by the fit minus its landmark's centre.
        rms: root mean square length of the residuals [m].
        sigma: error of one coordinate of one touch [m], from 3n - 6 degrees of freedom and the
            usual error of a touch.
        pivot: (3,) [m] centroid of the landmarks, phantom frame.
        covariance: (6, 6) [m, rad] of a small motion about `pivot` (see palpate.registration.pose).
        source: key or file that it comes from.
        summary: how well it fits, for a person.
        traced: (m, 3) [m] centres of the traced points that fit, phantom frame; empty without.
        alternatives: other poses that fit alike, as over a symmetric body.
    """

    phantom_from_robot: Transform
    residuals: FloatArray
    rms: float
    sigma: float
    pivot: FloatArray
    covariance: FloatArray
    source: str = "touches.csv"
    summary: str = ""
    traced: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    alternatives: tuple[RobotFit, ...] = ()

    def apart(self, other: RobotFit) -> tuple[FloatArray, FloatArray]:
        """Compare with another fit.

        Returns:
            motion (6,) [m, rad] about `pivot` from this pose to the other one, and the covariance
            (6, 6) that both together state for it.
        """
        motion = other.phantom_from_robot @ self.phantom_from_robot.inverse()
        moved = motion.apply(self.pivot[None])[0] - self.pivot
        lever = motion_jacobian(self.pivot[None], other.pivot)[0]
        there = np.vstack([lever, np.eye(6)[3:]])
        covariance = self.covariance + there @ other.covariance @ there.T
        return np.concatenate([moved, motion.rotation_vector]), covariance


def rigid_fits(
    source: FloatArray, targets: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit rigid motions from source (n, 3) [m] to each of targets (k, n, 3) [m].

    Returns:
        proper rotations (k, 3, 3), translations (k, 3) [m] and RMS (k,) [m].
    """
    a = source - source.mean(axis=0)
    b = targets - targets.mean(axis=1, keepdims=True)
    u, _, vt = np.linalg.svd(np.einsum("kni,nj->kij", b, a))
    sign = np.ones((len(targets), 3))
    sign[:, 2] = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    rotation = np.einsum("kij,kj,kjl->kil", u, sign, vt)
    left = b - np.einsum("kij,nj->kni", rotation, a)
    translation = targets.mean(axis=1) - rotation @ source.mean(axis=0)
    return rotation, translation, np.sqrt((left**2).sum(axis=2).mean(axis=1))


def similarity(touches: FloatArray, landmarks: FloatArray) -> tuple[float, float, float]:
    """Fit the scale of touches (n, 3) [m] to landmarks (n, 3) [m], in any two frames.

    Umeyama's fit touches = s R landmarks + t.

    Returns:
        size of the touched polygon over that of its landmarks [1], its standard error [1], and the
        RMS left [m].
    """
    rotation, _, _ = rigid_fits(landmarks, touches[None])
    a = (landmarks - landmarks.mean(axis=0)) @ rotation[0].T
    b = touches - touches.mean(axis=0)
    spread = float((a**2).sum())
    scale = float((a * b).sum()) / spread
    squares = float(((b - scale * a) ** 2).sum())
    sigma = max(FLOOR, np.sqrt(squares / max(3 * len(a) - 7, 1)))
    return scale, float(sigma / np.sqrt(spread)), float(np.sqrt(squares / len(a)))


def fit_robot(touches: FloatArray, landmarks: FloatArray) -> RobotFit:
    """Fit touches (n, 3) [m], robot frame, to the tool centres expected at their landmarks (n, 3)
    [m], phantom frame.

    At least three touches that do not lie on one line are needed, otherwise RegistrationError.
    Never a reflection.
    """
    if len(touches) < 3:
        raise RegistrationError(
            f"{len(touches)} touches found, at least 3 are needed: touch more landmarks",
            touches=len(touches),
        )
    for points, name in ((landmarks, "landmarks"), (touches, "touches")):
        widths = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
        if widths[1] < 1e-3 or widths[1] < 0.02 * widths[0]:
            raise RegistrationError(
                f"the {name} lie on one line (within {widths[1] * 1e3:.2f} mm), so the rotation "
                "about it is open: touch one aside"
            )
    rotation, translation, rms = rigid_fits(touches, landmarks[None])
    fit = Transform(rotation[0], translation[0])
    residuals = fit.apply(touches) - landmarks
    freedom = 3 * len(touches) - 6 + USUAL_WORTH - 2.0
    sigma = max(FLOOR, float(np.sqrt(((residuals**2).sum() + USUAL_WORTH * USUAL**2) / freedom)))
    pivot = landmarks.mean(axis=0)
    jacobian = motion_jacobian(landmarks, pivot).reshape(-1, 6)
    covariance = np.asarray(sigma**2 * np.linalg.inv(jacobian.T @ jacobian), dtype=float)
    summary = f"touches miss their landmarks by {1e3 * rms[0]:.2f} mm RMS"
    return RobotFit(fit, residuals, float(rms[0]), sigma, pivot, covariance, summary=summary)
