"""Bodies as they were cast: the stated surface with a smooth random offset along its normals.

A mould warps, gel shrinks unevenly, and a print's layers are sanded: the free surface differs from
its drawing by some tenths of a millimetre, alike over a centimetre or two. What is held stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from palpate.foundation.arrays import BoolArray, FloatArray, IntArray
from palpate.foundation.errors import EffectError
from palpate.setup.free_form.fixed_region import Faces
from palpate.setup.free_form.shape import Shape
from palpate.synthetic.nuisances.random_waves import sum_of_waves

__all__ = ["CastForm"]

_LENGTHS = 15e-3, 25e-3
"""Correlation length of the offset, least and largest [m]."""
_RAMP = 5e-3
"""Distance from what is held over which the offset grows from zero [m]."""
_FINE = 4e-3
"""Longest edge of the cast's triangles [m]."""
_SMOOTHED = 2e-3
"""Distance over which normals are averaged [m]."""
_WAVES = 400
"""Waves of the random field: so many that it is nearly Gaussian."""
_LARGEST = 2e-3
"""Largest offset, RMS [m]."""


@dataclass(frozen=True)
class CastForm:
    """One way in which casts differ from their drawing.

    Raises EffectError for an RMS that is not between 0 and 2 mm.

    Attributes:
        rms: of the offset [m], over the free surface farther than 5 mm from what is held.
        seed: of the random field, whose correlation length is 15 to 25 mm.
    """

    rms: float
    seed: int

    def __post_init__(self) -> None:
        if not 0.0 <= self.rms <= _LARGEST:
            raise EffectError(
                f"geometry_local: rms = {self.rms:g} m is outside 0 to {_LARGEST:g} m", rms=self.rms
            )

    @property
    def length(self) -> float:
        """Correlation length [m]: that of exp(-d^2 / (2 length^2)) over distances d."""
        return float(np.random.default_rng([self.seed, 61]).uniform(*_LENGTHS))

    def of(self, stated: Shape) -> Shape:
        """Return the cast of a stated body, held in the same places."""
        if self.rms == 0.0:
            return stated
        vertices, triangles, held = _refined(stated)
        moved = vertices + self._offsets(vertices, triangles, held)
        fixed = Faces.of(np.flatnonzero(held))
        return Shape(moved, triangles, fixed, stated.name, stated.in_view)

    def _offsets(self, vertices: FloatArray, triangles: IntArray, held: BoolArray) -> FloatArray:
        """Motion (v, 3) [m] of the vertices."""
        random = np.random.default_rng([self.seed, 62])
        waves = random.normal(size=(_WAVES, 3)) / self.length
        normals, areas = _free_normals(vertices, triangles[~held])
        away = _distance(vertices, vertices[triangles[held]])
        share = np.clip(away / _RAMP, 0.0, 1.0)
        height = sum_of_waves(vertices, waves, random) * share**2 * (3.0 - 2.0 * share)
        weight = np.where(away >= _RAMP, areas, 0.0)
        size = np.sqrt(weight @ height**2 / weight.sum())
        return np.asarray((self.rms / size * height)[:, None] * normals)


def _refined(stated: Shape) -> tuple[FloatArray, IntArray, BoolArray]:
    """Vertices [m], triangles without long edges, and which of them are held (t,)."""
    vertices, triangles, held = stated.vertices, stated.triangles, stated.held
    while True:
        ends = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        edges, number = np.unique(ends, axis=0, return_inverse=True)
        long = np.linalg.norm(np.diff(vertices[edges], axis=1)[:, 0], axis=1) > _FINE
        if not long.any():
            return vertices, triangles, held
        middle = np.where(long, len(vertices) + np.cumsum(long) - 1, -1)
        vertices = np.concatenate([vertices, vertices[edges[long]].mean(axis=1)])
        triangles, own = _split(triangles, middle[number.reshape(-1, 3)])
        held = held[own]


def _split(triangles: IntArray, middles: IntArray) -> tuple[IntArray, IntArray]:
    """Split triangles (t, 3) at the middles of their sides.

    Args:
        triangles: corners a, b, c.
        middles: (t, 3) vertices in the middle of ab, bc and ca; -1 for a side that is not split.

    Returns:
        triangles (s, 3) and the number of the one that each is a part of (s,).
    """
    count, rows = (middles >= 0).sum(axis=1), np.arange(len(triangles))
    # Turned so that the first side is split, and of two that are split the last one is not.
    turn = np.where(count == 2, (middles < 0).argmax(axis=1) + 1, (middles >= 0).argmax(axis=1)) % 3
    order = (np.arange(3) + turn[:, None]) % 3
    a, b, c = np.take_along_axis(triangles, order, axis=1).T
    ab, bc, ca = np.take_along_axis(middles, order, axis=1).T
    parts = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        3: [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)],
    }
    made, own = [], []
    for sides, pieces in parts.items():
        here = count == sides
        for piece in pieces:
            made.append(np.stack([corner[here] for corner in piece], axis=1))
            own.append(rows[here])
    return np.concatenate(made), np.concatenate(own)


def _free_normals(vertices: FloatArray, free: IntArray) -> tuple[FloatArray, FloatArray]:
    """Unit normals (v, 3) of the free surface, smoothed over edges so that no triangle folds, and
    its area (v,) [m^2] at each vertex; zero away from it.
    """
    a, b, c = vertices[free.T]
    across, areas = np.cross(b - a, c - a), np.zeros(len(vertices))
    for corner in range(3):
        np.add.at(areas, free[:, corner], np.linalg.norm(across, axis=1) / 6)
    own = np.flatnonzero(areas)
    near = cKDTree(vertices[own]).sparse_distance_matrix(
        cKDTree((a + b + c) / 3), 3 * _SMOOTHED, output_type="coo_matrix"
    )
    near.data = np.exp(-0.5 * (near.data / _SMOOTHED) ** 2)
    total = np.zeros_like(vertices)
    total[own] = near.tocsr() @ across
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return np.asarray(total / np.where(length > 0, length, 1.0)), areas


def _distance(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Distance (n,) [m] of points (n, 3) [m] to triangles (t, 3, 3)."""
    from palpate.setup.free_form.closest_point import nearest

    _, places = nearest(np.ascontiguousarray(points), np.ascontiguousarray(corners))
    return np.asarray(np.linalg.norm(points - places, axis=1))
