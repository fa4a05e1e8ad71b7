"""Refinement of a pose along the camera's rays, against a body of any shape and its table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.faces import (
    CELL,
    EDGE,
    GRAZING,
    SIDE_OFFSET,
    TABLE_REACH,
    Assignment,
    IndexArray,
    joined,
)
from palpate.registration.pose import motion_jacobian, small_motion
from palpate.registration.robust_weights import centred_weights, depth_noise, robust_weights
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.uncertainty import PRIOR

__all__ = ["BODY", "PARTS", "TABLE", "on_surface", "refined", "weighted"]

PARTS = ("surface", "table")
BODY, TABLE = 0, 1
"""Parts of the surface, and as `Assignment.face` numbers them."""
_LEAST_SAG = 0.05
"""Sag of the body's lowest parts, so that they count as the body's [1]."""
_LEAST_POINTS = 50
"""Least number of points of a fit."""
_MOST_POINTS = 8000
"""Most points of a fit."""
_ROUNDS, _WIDE, _HUBER = 25, 5, 8
"""Rounds of a fit, and how many of them have a wide gate and Huber's weights."""


def on_surface(
    cloud: FloatArray, body: SeenBody, pose: Transform, gate: float, *, table: bool
) -> Assignment:
    """Find the points whose rays end on the body or on its table.

    Args:
        cloud: (n, 3) [m], camera frame.
        body: as stated.
        pose: phantom_from_camera.
        gate: largest error along the surface's normal [m].
        table: whether the body stands on a table in z = 0.
    """
    points, camera = pose.apply(cloud), pose.translation
    ways = points - camera
    length = np.linalg.norm(ways, axis=1)
    ways /= length[:, None]
    hits = body.cast(camera, ways)
    on_body = _Part(hits.met, length - hits.distance, hits.normal, BODY)
    parts = [on_body]
    if table:
        parts.append(_table(body, camera, ways, length, hits.met | hits.hidden))
    found = [part.assignment(points, ways, body, gate) for part in parts]
    beside = ~hits.met & ~hits.hidden
    if table:  # lower points may be the table's
        beside &= points[:, 2] > gate
    return joined([*found, _beside(points, body, np.flatnonzero(beside), gate)])


@dataclass(frozen=True, eq=False)
class _Part:
    """Rays that meet one part of the surface.

    Attributes:
        met: (n,) whether a ray meets it.
        beyond: (n,) measured minus expected distance along the ray [m].
        normal: (n, 3) of the surface.
        face: number of the part.
    """

    met: BoolArray
    beyond: FloatArray
    normal: FloatArray
    face: int

    def assignment(
        self, points: FloatArray, ways: FloatArray, body: SeenBody, gate: float
    ) -> Assignment:
        """The points within `gate` [m] of the surface, along its normal."""
        slope = np.einsum("ni,ni->n", ways, self.normal)
        error = np.where(self.met, self.beyond, np.inf)
        near = self.met & (np.abs(slope) > GRAZING)
        near[near] &= np.abs(error[near] * slope[near]) < gate
        rows = np.flatnonzero(near)
        # Noise moves a point along its ray; its foot on the surface has none.
        feet = points[rows] - ways[rows] * error[rows, None]
        distance = error[rows] * slope[rows]
        return _assigned(
            body, rows, feet, self.normal[rows], distance, np.abs(slope[rows]), self.face
        )


def _table(
    body: SeenBody, camera: FloatArray, ways: FloatArray, length: FloatArray, hidden: BoolArray
) -> _Part:
    """The table in z = 0 around the body, where rays (n, 3) do not meet the body."""
    down = ~hidden & (ways[:, 2] < -1e-6)
    away = np.full(len(ways), np.inf)
    away[down] = -camera[2] / ways[down, 2]
    feet = camera[:2] + ways[:, :2] * np.where(down, away, 0.0)[:, None]
    low, high = body.geometry.low[:2] - 2 * EDGE, body.geometry.high[:2] + 2 * EDGE
    beside = np.maximum(low - feet, feet - high).max(axis=1)
    met = down & (beside > 0) & (beside < TABLE_REACH)
    error = np.where(met, length - np.where(down, away, 0.0), np.inf)
    return _Part(met, error, np.broadcast_to([0.0, 0.0, 1.0], ways.shape), TABLE)


def _beside(points: FloatArray, body: SeenBody, rows: IndexArray, gate: float) -> Assignment:
    """Points beside the body's outline, whose rays miss it, at the nearest place of its surface.

    They keep a pose from sliding off a part of the body.
    """
    places = body.nearest(points[rows])[0] if len(rows) else points[rows]
    away = points[rows] - places
    apart = np.linalg.norm(away, axis=1)
    near = (apart > 1e-6) & (apart < gate)
    rows, places, away, apart = rows[near], places[near], away[near], apart[near]
    return _assigned(body, rows, places, away / apart[:, None], apart, np.ones(len(rows)), BODY)


def _assigned(
    body: SeenBody,
    rows: IndexArray,
    feet: FloatArray,
    normals: FloatArray,
    distance: FloatArray,
    slant: FloatArray,
    face: int,
) -> Assignment:
    """Points of one part, with their cells and what a sagging body does to them."""
    table = face == TABLE
    cell = np.floor(feet / (1.5 * CELL if table else CELL)).astype(np.int64)
    if table:
        cell[:, 2] = 0
    height = np.clip(feet[:, 2] / max(body.geometry.height, 1e-9), 0.0, 1.0)
    # The top sinks, and what is upright bulges.
    sag = np.abs(normals[:, 2]) * height + SIDE_OFFSET * np.hypot(normals[:, 0], normals[:, 1])
    return Assignment(
        rows=rows,
        face=np.full(len(rows), face),
        points=feet,
        normals=normals,
        distance=distance,
        slant=slant,
        cell=cell,
        sag=np.zeros(len(rows)) if table else np.maximum(sag, _LEAST_SAG),
    )


def refined(
    cloud: FloatArray, body: SeenBody, pose: Transform, gate: float, *, table: bool
) -> Transform:
    """Refine a pose by Gauss-Newton on distances along rays, with robust weights.

    A wide prior about the given pose matters only in directions that nothing determines.

    Args and units are those of `on_surface`. Raises RegistrationError where fewer than 50 points
    lie on the body.
    """
    start, pivot = pose, body.middle
    step = max(1, len(cloud) // _MOST_POINTS)
    thinned = cloud[::step]
    for turn in range(_ROUNDS):
        found = on_surface(thinned, body, pose, gate * (3.0 if turn < _WIDE else 1.0), table=table)
        if (found.face == BODY).sum() < _LEAST_POINTS:
            raise RegistrationError(
                f"{(found.face == BODY).sum()} points of the rest cloud lie on the phantom, at "
                f"least {_LEAST_POINTS} are needed: check [phantom] surface and its unit"
            )
        noise = depth_noise(found.distance, found.slant)
        weights = robust_weights(found.distance, found.slant, noise, tukey=turn >= _HUBER)
        jacobian = np.einsum("ki,kij->kj", found.normals, motion_jacobian(found.points, pivot))
        weighty = jacobian * (weights / (noise * found.slant) ** 2)[:, None]
        drift = pose @ start.inverse()
        pull = np.concatenate([drift.apply(pivot[None])[0] - pivot, drift.rotation_vector])
        change = -np.linalg.solve(
            weighty.T @ jacobian + np.diag(1 / PRIOR**2),
            weighty.T @ found.distance + pull / PRIOR**2,
        )
        pose = small_motion(change, pivot) @ pose
        if turn > _HUBER and np.abs(change[:3]).max() < 1e-6 and np.abs(change[3:]).max() < 1e-5:
            break
    return pose


def weighted(
    cloud: FloatArray, body: SeenBody, pose: Transform, gate: float, *, table: bool
) -> tuple[Assignment, FloatArray]:
    """Points on the surface, and their robust weights (k,); arguments as for `on_surface`."""
    found = on_surface(cloud, body, pose, gate, table=table)
    return found, centred_weights(found.face, found.distance, found.slant)
