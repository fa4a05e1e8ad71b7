"""Distances between a surface and its successor, both ways."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["SurfaceDeviation", "even_points", "surface_deviation"]

_SAMPLES = 50_000
"""Points on each surface, spread evenly by area; and at most so many of its vertices."""


@dataclass(frozen=True)
class SurfaceDeviation:
    """Distances [m] of points of each surface from the nearest point of the other one.

    Attributes:
        new_largest: of the new surface from the old one: what was added or moved.
        new_rms: root mean square over the new surface's area.
        old_largest: of the old surface from the new one: what was removed or moved.
        old_rms: root mean square over the old surface's area.
    """

    new_largest: float
    new_rms: float
    old_largest: float
    old_rms: float

    @property
    def largest(self) -> float:
        """The largest distance either way [m]."""
        return max(self.new_largest, self.old_largest)


def surface_deviation(old: TriangleSurface, new: TriangleSurface) -> SurfaceDeviation:
    """Measure the distances between two surfaces by Open3D, at samples and vertices."""
    middle = old.vertices.mean(axis=0)
    return SurfaceDeviation(*_away(new, old, middle), *_away(old, new, middle))


def _away(surface: TriangleSurface, other: TriangleSurface, middle: FloatArray) -> tuple[Any, Any]:
    """Largest and RMS distance [m] of one surface's points from another surface."""
    import open3d as o3d

    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy((other.vertices - middle).astype(np.float32)),
        o3d.core.Tensor.from_numpy(other.triangles.astype(np.uint32)),
    )

    def distances(points: FloatArray) -> FloatArray:
        asked = o3d.core.Tensor.from_numpy((points - middle).astype(np.float32))
        return np.asarray(scene.compute_distance(asked).numpy(), dtype=float)

    step = -(-len(surface.vertices) // _SAMPLES)
    spread = distances(even_points(surface, _SAMPLES))
    ends = distances(surface.vertices[::step])
    return float(max(spread.max(), ends.max())), float(np.sqrt(np.mean(spread**2)))


def even_points(surface: TriangleSurface, count: int) -> FloatArray:
    """Points (count, 3) [m] spread evenly over a surface; the same at every call."""
    total = surface.areas.cumsum()
    step = np.arange(count) + 0.5
    chosen = np.minimum(np.searchsorted(total, step / count * total[-1]), len(total) - 1)
    # Two irrational steps fill the square evenly (Roberts 2018). Points beyond its diagonal are
    # folded back.
    shares = np.stack([step * 0.7548776662466927, step * 0.5698402909980532], axis=1) % 1.0
    shares = np.where(shares.sum(axis=1, keepdims=True) > 1, 1 - shares, shares)
    weights = np.concatenate([1 - shares.sum(axis=1, keepdims=True), shares], axis=1)
    return np.asarray(np.einsum("mk,mki->mi", weights, surface.corners[chosen]))
