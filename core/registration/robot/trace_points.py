"""Traced points against the surface of a body: distances of the ball, and one step of a fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.registration.shape.seen_body import SeenBody

__all__ = ["TracedBody", "press_prior", "small_rotations"]

_PRESS = 3.0e-4
"""Standard deviation of what the ball's centre is off the surface as a whole [m]: the ball presses
soft tissue in, and its radius is known to a tenth of a millimetre or two."""

_STEP = 5.0e-4
"""Step of a coarse derivative [m]."""


def press_prior() -> float:
    """Weight [1/m^2] of no common offset of all traced points."""
    return 1.0 / _PRESS**2


@dataclass(frozen=True, eq=False)
class TracedBody:
    """A body over whose free surface a ball slides.

    Attributes:
        body: at rest, phantom frame.
        radius: of the ball [m].
    """

    body: SeenBody
    radius: float

    def errors(self, centres: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compare centres of the ball with the surface.

        Args:
            centres: (..., 3) [m], phantom frame.

        Returns:
            gap (...) [m] between ball and surface, negative where the ball reaches into the body,
            and its derivative (..., 3) by the centre: a unit vector away from the body.
        """
        points = centres.reshape(-1, 3)
        places, normals = self.body.nearest(points)
        away = points - places
        length = np.linalg.norm(away, axis=1)
        outside = np.where(np.einsum("ni,ni->n", away, normals) < 0, -1.0, 1.0)
        near = length < 1e-7
        ways = away * (outside / np.where(near, 1.0, length))[:, None]
        ways[near] = normals[near]
        gaps = outside * length - self.radius
        return gaps.reshape(centres.shape[:-1]), ways.reshape(centres.shape)

    def coarse_errors(self, centres: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compare many centres like `errors`, within some tenths of a millimetre and with the base
        as part of the surface.
        """
        points, outside = centres.reshape(-1, 3), self.body.geometry.outside
        here = outside(points)
        slopes = np.stack([outside(points + way) - here for way in _STEP * np.eye(3)], axis=1)
        ways = slopes / np.maximum(np.linalg.norm(slopes, axis=1, keepdims=True), 1e-12)
        return (here - self.radius).reshape(centres.shape[:-1]), ways.reshape(centres.shape)


def small_rotations(vectors: FloatArray) -> FloatArray:
    """Rotation matrices (k, 3, 3) of rotation vectors (k, 3) [rad], by Rodrigues' formula."""
    angle = np.linalg.norm(vectors, axis=1)
    axis = vectors / np.maximum(angle, 1e-12)[:, None]
    cross = np.zeros((len(vectors), 3, 3))
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -axis[:, 2], axis[:, 1], -axis[:, 0]
    cross -= cross.transpose(0, 2, 1)
    sine, cosine = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.asarray(np.eye(3) + sine * cross + (1 - cosine) * cross @ cross)
