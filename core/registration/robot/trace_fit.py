"""Robot to phantom from traces: unordered places of a ball on the surface, some of them lifted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.pose import motion_jacobian, small_motion
from palpate.registration.robot.robot_fit import FLOOR, RobotFit
from palpate.registration.robot.trace_points import TracedBody, press_prior
from palpate.registration.robot.trace_search import search_poses
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.uncertainty import PRIOR
from palpate.setup.phantom_geometry import Geometry

__all__ = ["fit_traces", "refit_traces"]

_ROUNDS = 40
"""Most rounds of a fit."""
_TUKEY = 4.685
"""Gap beyond which a point is a lift [standard deviations]."""
_WIDEST = 1.5e-3
"""Largest standard deviation of the gaps that a fit starts with [m]."""
_TOGETHER = 5e-3
"""Points nearer than this share an error of cast and surface [m]."""
_ALIKE = 6.0
"""Difference of log likelihood below which two poses fit alike [nats]."""
_APART, _TURNED = 3e-3, np.radians(5.0)
"""Poses that differ by less, in place [m] and turn [rad], count as one."""
_TRIED = 12
"""Poses of a search that are refined."""
_REFITS, _SETTLED, _USUAL = 8, 1e-9, 2e-4
"""Most rounds of a fit to a changed body, its last change [m], and the usual error of a gap [m]."""
_FEWEST = 0.6
"""Least share of the traced points that lie on the surface [1]."""


@dataclass(frozen=True, eq=False)
class _Refined:
    """A pose that fits traces.

    Attributes:
        pose: phantom_from_robot.
        press: common offset of all points along the normal [m].
        weights: (n,) of the points.
        gaps: (n,) beyond the common offset [m].
        sigma: standard deviation of a gap [m].
        covariance: (6, 6) [m, rad] about the body's middle.
    """

    pose: Transform
    press: float
    weights: FloatArray
    gaps: FloatArray
    sigma: float
    covariance: FloatArray

    @property
    def used(self) -> int:
        """Number of points on the surface."""
        return int((self.weights > 0).sum())

    def log_likelihood(self, together: FloatArray, sigma: float) -> float:
        """Log likelihood [nats] up to a constant, with a given standard deviation [m]."""
        squares = np.minimum((self.gaps / sigma) ** 2, _TUKEY**2)
        return -0.5 * float((squares / together).sum() + self.press**2 * press_prior())


def fit_traces(
    points: FloatArray, geometry: Geometry, radius: float, guesses: Sequence[Transform] = ()
) -> RobotFit:
    """Fit traces to the surface of a body.

    Without a guess all poses are searched. Poses that fit alike are `alternatives`.

    Args:
        points: centres of the ball (n, 3) [m], robot frame; some may be lifted off the surface.
        geometry: of the body.
        radius: of the ball [m].
        guesses: phantom_from_robot; without any, a search finds them.

    Raises RegistrationError where no pose puts the points on the surface.
    """
    traced = TracedBody(SeenBody(geometry), radius)
    starts = list(guesses) or _distinct(search_poses(points, traced), traced)[:_TRIED]
    refined = [_refined(points, traced, start) for start in starts]
    together = _crowd(points)
    sigma = min(one.sigma for one in refined)
    scores = [one.log_likelihood(together, sigma) for one in refined]
    order = np.argsort(scores)[::-1]
    kept: list[_Refined] = []
    for number in order:
        if scores[number] < scores[order[0]] - _ALIKE:
            break
        if all(_differ(refined[number].pose, one.pose, traced) for one in kept):
            kept.append(refined[number])
    best = kept[0]
    if best.used < _FEWEST * len(points):
        raise RegistrationError(
            f"traces.csv: {best.used} of {len(points)} points lie on the phantom's surface in the "
            f"best pose, at least {_FEWEST:.0%} are needed: check [phantom] surface, its unit and "
            "[tool] radius, or state [robot] phantom_from_robot as a guess",
            used=best.used,
        )
    fits = [_fit(points, one, traced) for one in kept]
    return replace(fits[0], alternatives=tuple(fits[1:]))


def refit_traces(centres: FloatArray, geometry: Geometry, radius: float) -> Transform:
    """Move traced centres (n, 3) [m], phantom frame, onto the surface of a changed body.

    Every point counts, with a constant weight, so that the motion changes smoothly with body and
    radius.

    Returns:
        the motion, phantom frame.
    """
    traced, pose, press = TracedBody(_seen(geometry), radius), Transform(), 0.0
    pivot, weights = traced.body.middle, 1.0 / (_crowd(centres) * _USUAL**2)
    prior, damping = np.append(np.zeros(6), press_prior()), np.append(1.0 / PRIOR**2, 0.0)
    for _ in range(_REFITS):
        gaps, rows = _linearised(centres, traced, pose, press)
        weighted = rows * weights[:, None]
        pull = np.append(np.zeros(6), press)
        information = weighted.T @ rows + np.diag(prior + damping)
        change = -np.linalg.solve(information, weighted.T @ gaps + prior * pull)
        pose, press = small_motion(change[:6], pivot) @ pose, press + float(change[6])
        if np.abs(change[:3]).max() < _SETTLED:
            break
    return pose


def _linearised(
    points: FloatArray, traced: TracedBody, pose: Transform, press: float
) -> tuple[FloatArray, FloatArray]:
    """Gaps (n,) [m] beyond a common offset, and their derivatives (n, 7) by motion and offset."""
    moved = pose.apply(points)
    gaps, ways = traced.errors(moved)
    rows = np.einsum("ni,nij->nj", ways, motion_jacobian(moved, traced.body.middle))
    return gaps - press, np.column_stack([rows, -np.ones(len(rows))])


@lru_cache(maxsize=16)
def _seen(geometry: Geometry) -> SeenBody:
    return SeenBody(geometry)


def _refined(points: FloatArray, traced: TracedBody, pose: Transform) -> _Refined:
    """Refine a pose by Gauss-Newton with Tukey's weights; a common offset has a narrow prior."""
    pivot, together = traced.body.middle, _crowd(points)
    start, press, sigma = pose, 0.0, _WIDEST
    for _ in range(_ROUNDS):
        gaps, rows = _linearised(points, traced, pose, press)
        weights = np.clip(1.0 - (gaps / (_TUKEY * sigma)) ** 2, 0.0, None) ** 2
        weighted = rows * (weights / together / sigma**2)[:, None]
        drift = pose @ start.inverse()
        pull = np.concatenate([drift.apply(pivot[None])[0] - pivot, drift.rotation_vector, [press]])
        prior = np.append(1.0 / PRIOR**2, press_prior())
        information = weighted.T @ rows + np.diag(prior)
        change = -np.linalg.solve(information, weighted.T @ gaps + prior * pull)
        pose, press = small_motion(change[:6], pivot) @ pose, press + float(change[6])
        narrower = 1.4826 * float(np.median(np.abs(gaps[weights > 0]))) if weights.any() else sigma
        settled = np.abs(change[:3]).max() < 1e-7 and abs(narrower - sigma) < 1e-3 * sigma
        sigma = min(_WIDEST, max(FLOOR, narrower))
        if settled:
            break
    covariance = np.asarray(np.linalg.inv(information), dtype=float)[:6, :6]
    return _Refined(pose, press, weights, gaps, sigma, covariance)


def _crowd(points: FloatArray) -> FloatArray:
    """Number (n,) of points that share the error of each one."""
    tree = cKDTree(points)
    return np.asarray(tree.query_ball_point(points, _TOGETHER, return_length=True), dtype=float)


def _distinct(poses: list[Transform], traced: TracedBody) -> list[Transform]:
    """The poses that differ from all before them."""
    kept: list[Transform] = []
    for pose in poses:
        if all(_differ(pose, other, traced) for other in kept):
            kept.append(pose)
    return kept


def _differ(pose: Transform, other: Transform, traced: TracedBody) -> bool:
    """Whether two poses are not the same a little changed."""
    motion, middle = pose @ other.inverse(), traced.body.middle
    away = float(np.linalg.norm(motion.apply(middle[None])[0] - middle))
    return away > _APART or float(np.linalg.norm(motion.rotation_vector)) > _TURNED


def _fit(points: FloatArray, found: _Refined, traced: TracedBody) -> RobotFit:
    """Describe a refined pose."""
    on = found.weights > 0
    rms = float(np.sqrt((found.gaps[on] ** 2).mean()))
    lifts = len(points) - found.used
    summary = (
        f"{found.used} of {len(points)} traced points lie on the surface within {1e3 * rms:.2f} mm "
        f"RMS" + (f", {lifts} are lifts" if lifts else "")
    )
    return RobotFit(
        phantom_from_robot=found.pose,
        residuals=np.zeros((0, 3)),
        rms=rms,
        sigma=found.sigma,
        pivot=traced.body.middle,
        covariance=found.covariance,
        source="traces.csv",
        summary=summary,
        traced=found.pose.apply(points[on]),
    )
