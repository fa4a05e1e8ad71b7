"""A rest cloud as rays: which of its points may be the body's, and how well a pose explains all."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.registration.camera.guess import level
from palpate.registration.camera.table_plane import TablePlane
from palpate.registration.faces import CELL
from palpate.registration.shape.seen_body import SeenBody

__all__ = ["SeenRays"]

_FEWEST = 50
"""Least number of points that may be the body's."""
_LARGEST = 1.2
"""Largest reach of the points that may be the body's, over the body's own [1]."""
_MOST_OWN, _MOST_OTHERS = 2000, 1500
"""Most points that may be the body's, and most others, by which a pose is judged."""
_OUTLIER = 3.0
"""Error [standard deviations] from which on all errors count alike."""
_BIAS = 1.0e-3
"""Usual error of cast and camera beyond noise [m]."""
_SMOOTH = 0.5e-3
"""The same of averages over a cell [m], at the true pose."""


@dataclass(frozen=True, eq=False)
class SeenRays:
    """A rest cloud in a frame in which the camera's centre is known.

    With a table the frame has the table in z = 0; without, it is the camera's.

    Attributes:
        from_camera: pose of the camera in this frame.
        table: whether z = 0 is a table.
        points: (n, 3) [m], thinned.
        candidate: (n,) whether a point may be the body's.
        noise: of depth [m].
    """

    from_camera: Transform
    table: bool
    points: FloatArray
    candidate: BoolArray
    noise: float

    @classmethod
    def of(
        cls, cloud: FloatArray, body: SeenBody, noise: float, table: TablePlane | None = None
    ) -> Self:
        """Sort the points of a rest cloud.

        Args:
            cloud: (n, 3) [m], camera frame.
            body: as stated.
            noise: of depth [m].
            table: on which the body stands; None without one.

        Raises RegistrationError where too few points may be the body's.
        """
        frame = Transform() if table is None else level(table)
        points = frame.apply(cloud)
        candidate = _candidates(points, body, noise, table=table is not None)
        if candidate.sum() < _FEWEST:
            raise RegistrationError(
                f"{candidate.sum()} points of the rest cloud may be the phantom's, at least "
                f"{_FEWEST} are needed: check [phantom] surface and its unit, or give [camera] "
                "to_phantom"
            )
        middle = np.median(points[candidate], axis=0)
        around = np.linalg.norm(points - middle, axis=1) < 2.5 * body.reach_in_view
        random = np.random.default_rng(0)
        own = random.permutation(np.flatnonzero(candidate))[:_MOST_OWN]
        others = random.permutation(np.flatnonzero(around & ~candidate))[:_MOST_OTHERS]
        rows = np.concatenate([own, others])
        return cls(frame, table is not None, points[rows], candidate[rows], noise)

    @property
    def camera(self) -> FloatArray:
        """The camera's centre (3,) [m]."""
        return self.from_camera.translation

    @property
    def to_camera(self) -> Transform:
        """camera_from_view."""
        return self.from_camera.inverse()

    @property
    def own(self) -> FloatArray:
        """Points that may be the body's (m, 3) [m]."""
        return self.points[self.candidate]

    def misfit(self, body: SeenBody, pose: Transform, most: int = 10**9) -> float:
        """Mean squared error [variances] of depth under a pose, at most `_OUTLIER` squared a ray.

        A ray that should end on the body and does not counts like one that ends before it. A point
        that may be the body's and that no surface explains is an outlier.

        Args:
            body: as stated.
            pose: phantom_from_view.
            most: largest number of rays.
        """
        sigma = float(np.hypot(self.noise, _BIAS))
        error = np.abs(self._errors(body, pose, max(1, len(self.points) // most))) / sigma
        cost = np.minimum(error**2, _OUTLIER**2)
        return float(cost.mean())

    def explained(self, body: SeenBody, pose: Transform) -> float:
        """Share [1] of the points that may be the body's that a surface explains."""
        error = np.abs(self._errors(body, pose))[self.candidate]
        return float((error < max(1.5 * self.noise, 2.0e-3)).mean())

    def log_likelihood(self, body: SeenBody, pose: Transform) -> float:
        """Log likelihood [nats] of averages over cells, up to a constant.

        The averages leave smooth errors, of `_SMOOTH`, and hardly any noise. A ray that nothing
        explains counts as an outlier.
        """
        limit = _OUTLIER * float(np.hypot(self.noise, _BIAS))
        error = np.clip(self._errors(body, pose), -limit, limit)
        cell = np.unique(np.floor(self.points / CELL), axis=0, return_inverse=True)[1].ravel()
        count = np.bincount(cell)
        mean = np.bincount(cell, np.nan_to_num(error, posinf=limit)) / count
        variance = _SMOOTH**2 + self.noise**2 / count
        return float(-0.5 * np.minimum(mean**2 / variance, _OUTLIER**2).sum())

    def _errors(self, body: SeenBody, pose: Transform, step: int = 1) -> FloatArray:
        """Measured minus expected depth [m] of every `step`-th point; infinite where a point that
        may be the body's meets nothing.
        """
        origin, ends = pose.apply(self.camera[None])[0], pose.apply(self.points[::step])
        ways = ends - origin
        length = np.linalg.norm(ways, axis=1)
        ways /= length[:, None]
        hits = body.cast(origin, ways)
        expected = np.minimum(hits.distance, hits.blocked)
        if self.table:
            with np.errstate(divide="ignore"):
                floor = np.where(ways[:, 2] < 0, -origin[2] / ways[:, 2], np.inf)
            expected = np.minimum(expected, floor)
        known = np.isfinite(expected)
        missed = np.where(self.candidate[::step], np.inf, 0.0)
        return np.where(known, length - np.where(known, expected, 0.0), missed)


def _candidates(points: FloatArray, body: SeenBody, noise: float, *, table: bool) -> BoolArray:
    """Mask (n,) of the points (n, 3) [m] that may be the body's: the largest part that hangs
    together and is not larger than the body.
    """
    import open3d as o3d

    rows = np.arange(len(points))
    if table:
        height = points[:, 2]
        margin = max(3.0 * noise, 2.0e-3)
        rows = rows[(height > margin) & (height < body.geometry.height + 2 * margin)]
    rows = np.random.default_rng(1).permutation(rows)[:20000]
    result = np.zeros(len(points), dtype=bool)
    if len(rows) < _FEWEST:
        return result
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points[rows]))
    spacing = float(np.median(np.asarray(cloud.compute_nearest_neighbor_distance())))
    labels = np.asarray(
        cloud.cluster_dbscan(eps=max(6.0 * spacing, 2.0 * noise, 2.0e-3), min_points=8)
    )
    sizes = np.bincount(labels[labels >= 0]) if (labels >= 0).any() else np.zeros(0, int)
    for number in np.argsort(-sizes):
        part = points[rows[labels == number]]
        low, high = np.percentile(part, [1, 99], axis=0)
        from_middle = np.linalg.norm(part - 0.5 * (low + high), axis=1)
        if np.percentile(from_middle, 99) < _LARGEST * body.reach_in_view + noise:
            result[rows[labels == number]] = True
            return result
    return result
