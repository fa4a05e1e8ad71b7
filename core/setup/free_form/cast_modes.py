"""Smooth normal offsets of a free form's surface, by which a cast may differ from its drawing.

An offset is a sum of modes. They are those of a Gaussian process with a squared exponential
covariance (Karhunen and Loeve; Rasmussen and Williams 2006, 4.3), the strongest ones, so that
independent coefficients of one deviation give smooth fields of about that deviation everywhere. The
offset is zero on what is held, and grows from there over some millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.errors import SetupError
from palpate.setup.free_form.shape import Shape

__all__ = ["CAST_MODES", "CastModes", "Coefficients", "cast_modes", "check_cast"]

CAST_MODES = 24
"""Number of modes: nine tenths and more of such a field on bodies up to the size of a hand."""
_LENGTH = 18e-3
"""Correlation length of the offset [m]."""
_RAMP = 5e-3
"""Distance from what is held over which an offset grows from zero [m]."""
_NEIGHBOURS = 12
"""Triangles over which a normal is averaged, so that it turns smoothly over an edge."""
_BLENDED = 4
"""Places between which a field is interpolated."""

Coefficients = tuple[float, ...]
"""Factor of each mode [m]."""


@dataclass(frozen=True, eq=False)
class CastModes:
    """The modes of one body, at places close together on its free surface.

    Attributes:
        places: (n, 3) [m].
        normals: (n, 3) outward unit normals, smoothed over edges.
        heights: (n, k) of the modes [1].
        free: (n,) whether a place is farther than 5 mm from what is held.
    """

    places: FloatArray
    normals: FloatArray
    heights: FloatArray
    free: BoolArray

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.places)

    @cached_property
    def _squares(self) -> FloatArray:
        """Mean product (k, k) of the modes over the free surface away from what is held."""
        own = self.heights[self.free]
        return np.asarray(own.T @ own / len(own))

    def rms(self, coefficients: Coefficients) -> float:
        """RMS offset [m] over the free surface farther than 5 mm from what is held."""
        factors = np.array(coefficients)
        return float(np.sqrt(factors @ self._squares @ factors))

    def largest(self, coefficients: Coefficients) -> float:
        """Largest offset either way [m]; zero without coefficients."""
        return float(np.abs(self.heights @ np.array(coefficients)).max()) if coefficients else 0.0

    def at(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return heights (m, k) [1] and normals (m, 3) at points (m, 3) [m] of the free surface."""
        distance, rows = self._tree.query(points, k=_BLENDED)
        shares = 1.0 / np.maximum(distance, 1e-9) ** 2
        shares = shares / shares.sum(axis=1, keepdims=True)
        normals = np.einsum("mk,mki->mi", shares, self.normals[rows])
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        return np.einsum("mk,mkn->mn", shares, self.heights[rows]), normals

    def offset(self, coefficients: Coefficients, points: FloatArray) -> FloatArray:
        """Return the offset (m,) [m] at points (m, 3) [m] of the free surface."""
        return np.asarray(self.at(points)[0] @ np.array(coefficients))

    def motion(self, coefficients: Coefficients, points: FloatArray) -> FloatArray:
        """Return the motion (m, 3) [m] of points (m, 3) [m] of the free surface."""
        if not coefficients:
            return np.zeros_like(points)
        heights, normals = self.at(points)
        return np.asarray((heights @ np.array(coefficients))[:, None] * normals)


def check_cast(coefficients: Coefficients, is_block: bool) -> None:
    """Raise SetupError for an offset of a block, and for another number of coefficients than there
    are modes; none at all are no offset.
    """
    if coefficients and is_block:
        raise SetupError(
            "the cast of a block has no local offset here; state the block's surface as a file",
            key="cast",
        )
    if len(coefficients) not in (0, CAST_MODES):
        raise SetupError(
            f"cast has {len(coefficients)} coefficients; state {CAST_MODES}, or none", key="cast"
        )


@lru_cache(maxsize=8)
def cast_modes(shape: Shape) -> CastModes:
    """Return the modes of a body."""
    surface = shape.surface()
    places, faces = surface.vertices, surface.faces
    a, b, c = places[faces.T]
    across = np.cross(b - a, c - a)
    near = cKDTree((a + b + c) / 3).query(places, k=min(_NEIGHBOURS, len(faces)))[1]
    normals = across[near].sum(axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    away = _away_from_held(shape, places)
    knots = surface.patch_centres
    share = _ramp(_away_from_held(shape, knots))
    values, vectors = np.linalg.eigh(share[:, None] * _covariance(knots, knots) * share)
    strongest = slice(-1, -1 - CAST_MODES, -1)
    values, vectors = values[strongest], vectors[:, strongest]
    # The sign of an eigenvector is arbitrary.
    vectors = vectors * np.where(vectors.sum(axis=0) < 0, -1.0, 1.0)
    heights = _covariance(places, knots) @ (share[:, None] * vectors / np.sqrt(values))
    return CastModes(places, normals, _ramp(away)[:, None] * heights, away >= _RAMP)


def _covariance(one: FloatArray, other: FloatArray) -> FloatArray:
    """Covariance (m, n) [1] of the field at places (m, 3) and (n, 3) [m]."""
    squares = (one**2).sum(axis=1)[:, None] + (other**2).sum(axis=1) - 2.0 * one @ other.T
    return np.asarray(np.exp(-0.5 * np.maximum(squares, 0.0) / _LENGTH**2))


def _away_from_held(shape: Shape, points: FloatArray) -> FloatArray:
    """Distance (m,) [m] of points (m, 3) [m] to what is held."""
    from palpate.setup.free_form.closest_point import nearest

    held = np.ascontiguousarray(shape.corners[shape.held])
    _, places = nearest(np.ascontiguousarray(points, float), held)
    return np.asarray(np.linalg.norm(points - places, axis=1))


def _ramp(away: FloatArray) -> FloatArray:
    """Share (m,) [1] of the offset at distances (m,) [m] from what is held."""
    share = np.clip(away / _RAMP, 0.0, 1.0)
    return np.asarray(share**2 * (3.0 - 2.0 * share))
