"""The camera's pose as fitted to a rest cloud, with statistics, covariance and doubts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.camera.guess import half_turn
from palpate.registration.faces import Assignment
from palpate.registration.uncertainty import PoseEstimate, weak_directions

__all__ = ["EXPLAINED_LEAST", "LEAST_POINTS", "CameraFit"]

EXPLAINED_LEAST = 0.7
"""Share of points on the stated surface below which a warning is given [1]."""
LEAST_POINTS = 50
"""Least number of points of a fit."""


@dataclass(frozen=True, eq=False)
class CameraFit:
    """Camera to phantom.

    Attributes:
        phantom_from_camera: the fit.
        covariance: (6, 6) [m, rad] of a small motion about `pivot` (see palpate.registration.pose),
            smooth sensor bias included.
        pivot: (3,) centre of the block's top [m], phantom frame.
        lever: half the block's diagonal [m], which converts rotations to distances.
        rms: weighted RMS of point-to-plane distances [m].
        noise: white noise of the sensor along the line of sight [m].
        bias: size of the sensor's smooth error [m].
        face_counts: number of points on each face.
        face_offsets: mean distance of each face's points from its plane [m], positive outside.
        table_height: of the table's points over z = 0 [m]; NaN without a visible table.
        weak_directions: sentences about poorly determined directions.
        explained: share of the points near the block that lie on its stated surface [1].
        automatic: whether the first guess was found, not given.
        warnings: for a person.
        ambiguity: the warning that other poses fit as well; empty where none does.
        alternatives: of other poses that fit about as well, without alternatives of their own.
        view: (x/z, y/z) of the corners of the convex part of the image in which the rest cloud
            lies, camera frame; empty for a block, whose visible sides count wholly.
    """

    phantom_from_camera: Transform
    covariance: FloatArray
    pivot: FloatArray
    lever: float
    rms: float
    noise: float
    bias: float
    face_counts: dict[str, int]
    face_offsets: dict[str, float]
    table_height: float
    weak_directions: tuple[str, ...]
    explained: float
    automatic: bool
    warnings: tuple[str, ...]
    ambiguity: str = ""
    alternatives: tuple[CameraFit, ...] = ()
    view: tuple[tuple[float, float], ...] = ()

    @classmethod
    def of(
        cls,
        pose: Transform,
        last: PoseEstimate,
        found: Assignment,
        weights: FloatArray,
        names: Sequence[str],
        *,
        pivot: FloatArray,
        lever: float,
    ) -> CameraFit:
        """A fit with the statistics of its points, without what only its maker knows.

        Args:
            pose: phantom_from_camera.
            last: estimate of the pose's last step.
            found: points on the surface.
            weights: their robust weights (k,).
            names: of the surface's parts, as `found.face` numbers them.
            pivot: as the attribute.
            lever: as the attribute.
        """
        parts = [(name, found.face == number) for number, name in enumerate(names)]
        parts = [(name, here) for name, here in parts if (weights[here] > 0).any()]
        counts = {name: int((weights[here] > 0).sum()) for name, here in parts}
        offsets = {
            name: float(np.average(found.distance[here], weights=weights[here]))
            for name, here in parts
        }
        return cls(
            phantom_from_camera=pose,
            covariance=last.covariance,
            pivot=pivot,
            lever=lever,
            rms=float(np.sqrt(np.average(found.distance**2, weights=weights))),
            noise=0.0,
            bias=last.bias,
            face_counts=counts,
            face_offsets=offsets,
            table_height=offsets.get("table", float("nan")),
            weak_directions=weak_directions(last.covariance, counts, lever),
            explained=0.0,
            automatic=True,
            warnings=(),
        )

    @property
    def turned(self) -> Transform:
        """phantom_from_camera with the block turned by half a turn about z, which fits a plain
        block equally well.
        """
        return half_turn() @ self.phantom_from_camera
