"""Error of a free form's camera registration where the body has another size or depth is misread.

The registration itself (`palpate.registration.shape.shape_fit`) is run on virtual rest clouds: of
the body a little longer and shorter along each axis, and read with a little offset and scale of
depth. The poses that it finds, over these changes, are its response.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import ConvexHull

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.pose import small_motion
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.shape.shape_fit import settled_pose
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Sensor

__all__ = ["registration_error"]

_STEPS = (0.02, 0.02, 0.02, 2e-3, 0.01)
"""Changes of the lengths along x, y, z [1], of the offset of depth [m], and of its scale [1]."""
_RAYS = 90
"""Rays along each edge of a virtual image."""
_TABLE_WIDTH = 0.05
"""Width of the visible table around the body [m]."""


def registration_error(
    geometry: Geometry, pose: Transform, sensor: Sensor, factors: FloatArray
) -> Transform:
    """Motion from the registered to the true phantom_from_camera, to first order.

    Args:
        geometry: of the stated body.
        pose: registered phantom_from_camera.
        sensor: what it sees, how accurately, and how it misreads depth.
        factors: true over stated lengths along x, y, z (3,) [1].
    """
    misread = (sensor.depth_offset, sensor.depth_scale - 1.0)
    changes = np.array([*(np.asarray(factors) - 1.0), *misread])
    key = tuple(pose.matrix.ravel().tolist())
    found = _response(geometry, key, sensor.depth_sigma, sensor.view) @ changes
    return small_motion(found, _pivot(geometry)).inverse()


def _pivot(geometry: Geometry) -> FloatArray:
    return SeenBody(geometry).middle


@lru_cache(maxsize=8)
def _response(
    geometry: Geometry,
    key: tuple[float, ...],
    depth_sigma: float,
    view: tuple[tuple[float, float], ...],
) -> FloatArray:
    """Motion (6,) [m, rad] of the registered pose from the true one over each change (5,)."""
    matrix = np.array(key).reshape(4, 4)
    pose = Transform(matrix[:3, :3], matrix[:3, 3])
    columns = []
    for number, step in enumerate(_STEPS):
        ends = []
        for sign in (1.0, -1.0):
            change = np.zeros(len(_STEPS))
            change[number] = sign * step
            cloud = _virtual_cloud(geometry, pose, depth_sigma, change)
            cloud = cloud[_within(cloud, view)]
            found = settled_pose(cloud, SeenBody(geometry), pose, depth_sigma, table=True)
            motion, pivot = found @ pose.inverse(), _pivot(geometry)
            shift = motion.apply(pivot[None])[0] - pivot
            ends.append(np.concatenate([shift, motion.rotation_vector]))
        columns.append((ends[0] - ends[1]) / (2 * step))
    return np.stack(columns, axis=1)


def _within(cloud: FloatArray, view: tuple[tuple[float, float], ...]) -> BoolArray:
    """Whether each point (n, 3) [m] lies in the part of the image that is seen."""
    if not view:
        return np.ones(len(cloud), dtype=bool)
    sides = ConvexHull(np.array(view)).equations
    image = cloud[:, :2] / cloud[:, 2:]
    return np.asarray((image @ sides[:, :2].T + sides[:, 2] <= 0).all(axis=1))


def _virtual_cloud(
    geometry: Geometry, pose: Transform, depth_sigma: float, change: FloatArray
) -> FloatArray:
    """Rest cloud (n, 3) [m], camera frame, of a body of another size on its table, misread."""
    body, eye = SeenBody(geometry.scaled(1.0 + change[:3])), pose.translation
    toward = pose.inverse().apply(body.middle[None])[0]
    half = (body.reach + _TABLE_WIDTH) / toward[2]
    steps = np.linspace(-half, half, _RAYS)
    u, v = (grid.ravel() for grid in np.meshgrid(steps, steps))
    ways = np.stack([u + toward[0] / toward[2], v + toward[1] / toward[2], np.ones(len(u))], axis=1)
    length = np.linalg.norm(ways, axis=1)
    lines = pose.rotate(ways / length[:, None])
    with np.errstate(divide="ignore"):
        to_table = np.where(lines[:, 2] < 0, -eye[2] / lines[:, 2], np.inf)
    depth = np.minimum(body.cast(eye, lines).distance, to_table) / length
    met = np.isfinite(depth)
    # The same noise in every cloud, so that it cancels from one to the next.
    noise = np.random.default_rng(0).normal(0.0, depth_sigma, len(depth))
    read = (1.0 + change[4]) * depth[met] + change[3] + noise[met]
    return np.asarray(ways[met] * read[:, None])
