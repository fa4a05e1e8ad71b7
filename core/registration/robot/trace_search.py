"""Search for the pose of a robot by traces over a body: many rotations at once, the best kept."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.robot.trace_points import TracedBody, small_rotations
from palpate.registration.shape.even_rotations import even_rotations

__all__ = ["search_poses"]

_ROTATIONS = 1200
"""Rotations that are tried."""
_POINTS = 60
"""Traced points by which a start is improved."""
_GATES = (0.1, 0.05, 0.03, 0.02, 0.015, 0.01, 8e-3, 6e-3, 5e-3, 5e-3, 4e-3, 4e-3, 4e-3, 4e-3)
"""Gap beyond which a point does not count, round by round [m]."""
_KEPT = 40
"""Starts that are improved further with all points."""
_APART, _TURNED = 0.02, np.radians(10.0)
"""Starts that differ by less, in place of the robot's origin [m] and turn [rad], count as one."""
_OUTLIER = 3.0
"""Gap [standard deviations] from which on all gaps count alike."""
_TOLERANCE = 1.0e-3
"""Usual gap of a traced point at the true pose [m]."""
_LOWEST = -2.0e-3
"""Least height of the ball's lowest point over the table [m]."""


def search_poses(points: FloatArray, traced: TracedBody) -> list[Transform]:
    """Return poses phantom_from_robot that may be right, best first.

    Args:
        points: traced centres (n, 3) [m], robot frame.
        traced: body and ball.
    """
    some = points[:: max(1, len(points) // _POINTS)]
    rotations = even_rotations(_ROTATIONS)
    body = traced.body
    target = body.middle + np.array([0.0, 0.0, 0.25 * body.geometry.height])
    translations = target - rotations @ some.mean(axis=0)
    for gate in _GATES:
        rotations, translations = _improved(some, traced, rotations, translations, gate)
    best = _distinct(_costs(some, traced, rotations, translations), rotations, translations)
    rotations, translations = rotations[best], translations[best]
    for gate in _GATES[-4:]:
        rotations, translations = _improved(points, traced, rotations, translations, gate)
    costs = _costs(points, traced, rotations, translations)
    return [Transform(_proper(rotations[k]), translations[k]) for k in np.argsort(costs)]


def _distinct(costs: FloatArray, rotations: FloatArray, translations: FloatArray) -> list[int]:
    """Numbers of the best poses that differ from all better ones."""
    kept: list[int] = []
    for number in np.argsort(costs):
        turned = np.einsum("kij,ij->k", rotations[kept], rotations[number])
        away = np.linalg.norm(translations[kept] - translations[number], axis=1)
        if not ((turned > 1.0 + 2.0 * np.cos(_TURNED)) & (away < _APART)).any():
            kept.append(int(number))
            if len(kept) == _KEPT:
                break
    return kept


def _improved(
    points: FloatArray,
    traced: TracedBody,
    rotations: FloatArray,
    translations: FloatArray,
    gate: float,
) -> tuple[FloatArray, FloatArray]:
    """One Gauss-Newton step of every pose (k, 3, 3), (k, 3), with Tukey's weights within a gate."""
    moved = points @ rotations.transpose(0, 2, 1) + translations[:, None]
    gaps, ways = traced.coarse_errors(moved)
    weights = np.clip(1.0 - (gaps / gate) ** 2, 0.0, None) ** 2
    pivot, lever = traced.body.middle, traced.body.reach
    rows = np.concatenate([ways, np.cross(moved - pivot, ways) / lever], axis=2)
    weighted = rows * weights[..., None]
    matrices = weighted.transpose(0, 2, 1) @ rows + 1e-3 * np.eye(6)
    sides = np.einsum("kni,kn->ki", weighted, gaps)
    change = -np.linalg.solve(matrices, sides[..., None])[..., 0]
    turns = small_rotations(np.clip(change[:, 3:] / lever, -0.5, 0.5))
    shifted = (turns @ (translations - pivot)[..., None])[..., 0] + pivot + change[:, :3]
    return turns @ rotations, shifted


def _costs(
    points: FloatArray, traced: TracedBody, rotations: FloatArray, translations: FloatArray
) -> FloatArray:
    """Mean squared gap (k,) [variances] of poses; a ball in the table counts as an outlier."""
    moved = points @ rotations.transpose(0, 2, 1) + translations[:, None]
    gaps, _ = traced.coarse_errors(moved)
    squares = np.minimum((gaps / _TOLERANCE) ** 2, _OUTLIER**2)
    in_table = moved[..., 2] - traced.radius < _LOWEST
    return np.asarray(np.where(in_table, _OUTLIER**2, squares).mean(axis=1))


def _proper(rotation: FloatArray) -> FloatArray:
    """The rotation (3, 3) nearest to a matrix that many steps have rounded."""
    u, _, vt = np.linalg.svd(rotation)
    return np.asarray(u @ vt)
