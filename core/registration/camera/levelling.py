"""Upright display of a raw cloud: the table at z = 0, seen from the camera's side.

This is no registration; it only makes a cloud easier to look at.
"""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

__all__ = ["as_seen", "levelled"]

DRAWS, SUBSET = 400, 1500
"""Number of RANSAC draws, and of points that are used."""
INLIER, LEAST_SHARE, BEHIND = 3.0e-3, 0.08, 6.0e-3
"""Largest distance of an inlier [m], least share of inliers [1], and distance behind the plane from
which points count against it [m]."""


def as_seen(cloud: FloatArray) -> Transform:
    """The camera's axes turned so that its up is z and its view is y, with the middle of the cloud
    (n, 3) [m] over the origin.
    """
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    points = cloud @ turn.T
    low = np.percentile(points, 2, axis=0)
    middle = np.median(points, axis=0)
    return Transform(turn, -np.array([middle[0], middle[1], low[2]]))


def levelled(cloud: FloatArray, seed: int = 0) -> Transform:
    """A camera pose in which the table of its cloud (n, 3) [m] is z = 0 and the camera is on the -y
    side.

    The table is the large plane with fewest points behind it, by RANSAC (Fischler and Bolles 1981);
    `as_seen` without one.
    """
    rng = np.random.default_rng(seed)
    points = cloud[rng.permutation(len(cloud))[:SUBSET]]
    best: tuple[float, FloatArray, float] | None = None
    for _ in range(DRAWS):
        corner = points[rng.choice(len(points), 3, replace=False)]
        normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
        length = float(np.linalg.norm(normal))
        if length < 1e-6:
            continue
        normal = normal / length
        # Towards the camera, which is the origin.
        normal = normal if normal @ corner[0] < 0 else -normal
        height = (points - corner[0]) @ normal
        share = float((np.abs(height) < INLIER).mean())
        score = share - 4.0 * float((height < -BEHIND).mean())
        if share > LEAST_SHARE and (best is None or score > best[0]):
            best = (score, normal, float(normal @ corner[0]))
    if best is None:
        return as_seen(cloud)
    _, up, offset = best
    # The line of sight, projected on the table.
    away = -up * (up @ np.array([0.0, 0.0, 1.0])) + np.array([0.0, 0.0, 1.0])
    away = away if np.linalg.norm(away) > 1e-3 else np.array([0.0, -1.0, 0.0]) + up * up[1]
    away = away / np.linalg.norm(away)
    turn = np.stack([np.cross(away, up), away, up])
    raised = cloud @ turn.T - np.array([0.0, 0.0, offset])
    above = raised[raised[:, 2] > BEHIND]
    middle = np.median(above if len(above) else raised, axis=0)
    return Transform(turn, -np.array([middle[0], middle[1], offset]))
