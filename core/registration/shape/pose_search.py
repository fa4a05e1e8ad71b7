"""Search for the pose of a body in a rest cloud: many starts, each improved, the best kept.

A table leaves heading and place open; without one, every rotation is tried.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.pose import motion_jacobian, small_motion
from palpate.registration.shape.even_rotations import even_rotations
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.shape.seen_rays import SeenRays

__all__ = ["Hypothesis", "find_poses", "improved"]

_HEADINGS, _ROTATIONS = 36, 800
"""Rotations that are tried with a table, and without one."""
_ASIDE = 0.4
"""Starts beside the middle, over the body's reach [1]: a part of the body may be out of view."""
_PROMISING = 200
"""Starts of many that are improved."""
_RAYS = 400
"""Rays by which a start is judged."""
_LOWEST = -0.2
"""Least height of the camera over the body's middle, over its distance [1]: the base is unseen."""
_KEPT = 6
"""Poses that are kept."""
_POINTS = 300
"""Points by which a start is improved."""
_GATES = (20e-3, 15e-3, 10e-3, 8e-3, 6e-3, 5e-3, 4e-3, 4e-3, 4e-3, 4e-3, 4e-3, 4e-3)
"""Distance beyond which a point does not count, round by round [m]."""
_APART, _TURNED = 4e-3, np.radians(8.0)
"""Poses that differ by less, in place [m] and turn [rad], count as one."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A pose of the camera that may be right.

    Attributes:
        pose: phantom_from_view.
        misfit: mean squared error of depth (`SeenRays.misfit`) [variances].
    """

    pose: Transform
    misfit: float

    def differs(self, other: Hypothesis, body: SeenBody) -> bool:
        """Whether the other pose is another one, and not the same a little changed."""
        motion = self.pose @ other.pose.inverse()
        away = float(np.linalg.norm(motion.apply(body.middle[None])[0] - body.middle))
        return away > _APART or float(np.linalg.norm(motion.rotation_vector)) > _TURNED


def find_poses(view: SeenRays, body: SeenBody) -> list[Hypothesis]:
    """Return poses that may be right, best first, each different from those before it.

    Args:
        view: the rest cloud.
        body: as stated.
    """
    rotations = _headings() if view.table else list(even_rotations(_ROTATIONS))
    found = [start for rotation in rotations for start in _starts(view, body, rotation)]
    if len(found) > _PROMISING:
        found = sorted(found, key=lambda one: one.misfit)[:_PROMISING]
    found = sorted(
        (_hypothesis(view, body, improved(view, body, one.pose)) for one in found),
        key=lambda one: one.misfit,
    )
    return distinct(found, body)[:_KEPT]


def distinct(found: Iterable[Hypothesis], body: SeenBody) -> list[Hypothesis]:
    """Return the hypotheses that differ from all before them."""
    kept: list[Hypothesis] = []
    for one in found:
        if all(one.differs(other, body) for other in kept):
            kept.append(one)
    return kept


def _hypothesis(view: SeenRays, body: SeenBody, pose: Transform) -> Hypothesis:
    return Hypothesis(pose, view.misfit(body, pose))


def _headings() -> list[FloatArray]:
    """Rotations (3, 3) about z."""
    angles = np.arange(_HEADINGS) * (2 * np.pi / _HEADINGS)
    return [np.asarray(Rotation.from_euler("z", angle).as_matrix()) for angle in angles]


def _starts(view: SeenRays, body: SeenBody, rotation: FloatArray) -> list[Hypothesis]:
    """Put the middle of what may be the body on the middle of what a camera would see of it, and
    beside it, across the line of sight.
    """
    middle = rotation @ np.median(view.own, axis=0)
    camera = rotation @ view.camera
    shift = body.middle - middle
    way = np.array([0.0, 0.0, 1.0])
    for _ in range(2):
        away = camera + shift - body.middle
        distance = float(np.linalg.norm(away))
        way = away / distance
        shift = body.seen_from(way, max(distance, 2 * body.reach)) - middle
    if way[2] < _LOWEST:
        return []
    across = np.eye(3)[:2] if view.table else np.linalg.svd(way[None])[2][1:]
    aside = _ASIDE * body.reach * np.array([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]]) @ across
    shifts = shift + aside
    if view.table:
        shifts[:, 2] = 0.0
    poses = [Transform(rotation, one) for one in shifts]
    return [Hypothesis(pose, view.misfit(body, pose, _RAYS)) for pose in poses]


def improved(view: SeenRays, body: SeenBody, pose: Transform) -> Transform:
    """Improve a pose by point-to-plane ICP with Tukey's weights whose reach shrinks.

    With a table the body keeps standing on it.
    """
    points = view.own[:: max(1, len(view.own) // _POINTS)]
    free = [0, 1, 5] if view.table else [0, 1, 2, 3, 4, 5]
    lever = np.array([1.0, 1.0, 1.0, body.reach, body.reach, body.reach])[free]
    for gate in _GATES:
        moved = pose.apply(points)
        places, normals = body.nearest(moved)
        away = np.einsum("ni,ni->n", moved - places, normals)
        apart = np.linalg.norm(moved - places, axis=1)
        weights = np.clip(1.0 - (apart / gate) ** 2, 0.0, None) ** 2
        rows = np.einsum("ni,nij->nj", normals, motion_jacobian(moved, body.middle))[:, free]
        rows = rows / lever
        matrix = (rows * weights[:, None]).T @ rows + 1e-3 * np.eye(len(free))
        change = np.zeros(6)
        change[free] = -np.linalg.solve(matrix, rows.T @ (weights * away)) / lever
        pose = small_motion(change, body.middle) @ pose
    return pose
