"""A body under rays: where they meet it, and its points nearest to others (Embree in Open3D)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.setup.free_form.solids_in_view import distances_along
from palpate.setup.phantom_geometry import Geometry

__all__ = ["Hits", "SeenBody"]


@dataclass(frozen=True, eq=False)
class Hits:
    """Places at which rays meet a surface.

    Attributes:
        distance: (n,) from the rays' origin [m]; infinite where a ray misses, or meets the surface
            from inside.
        normal: (n, 3) outward normals; zero where a ray misses.
        blocked: (n,) distance [m] to a rigid thing in front of the body; infinite without one.
    """

    distance: FloatArray
    normal: FloatArray
    blocked: FloatArray

    @property
    def met(self) -> BoolArray:
        """Whether each ray meets the surface (n,)."""
        return np.isfinite(self.distance)

    @property
    def hidden(self) -> BoolArray:
        """Whether each ray ends on a rigid thing in front of the body (n,)."""
        return np.isfinite(self.blocked)


@dataclass(frozen=True, eq=False)
class SeenBody:
    """The free surface of a body at rest, phantom frame.

    Attributes:
        geometry: the body.
    """

    geometry: Geometry

    @cached_property
    def _scene(self) -> tuple[Any, FloatArray]:
        """Open3D's scene of the free surface, and the normals of its triangles (t, 3)."""
        import open3d as o3d

        surface = self.geometry.surface()
        scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        scene.add_triangles(
            o3d.core.Tensor.from_numpy(surface.vertices.astype(np.float32)),
            o3d.core.Tensor.from_numpy(surface.faces.astype(np.uint32)),
        )
        a, b, c = surface.vertices[surface.faces.T]
        normals = np.cross(b - a, c - a)
        return scene, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    @cached_property
    def middle(self) -> FloatArray:
        """Middle of the body's bounds (3,) [m]."""
        return np.asarray(0.5 * (self.geometry.low + self.geometry.high))

    @cached_property
    def reach(self) -> float:
        """Half the diagonal of the body's bounds [m]."""
        return float(np.linalg.norm(self.geometry.high - self.geometry.low)) / 2

    @cached_property
    def reach_in_view(self) -> float:
        """Largest distance [m] from the body's middle of what is seen of it and around it."""
        around = [vertices for vertices, _ in self.geometry.in_view]
        far = [np.linalg.norm(vertices - self.middle, axis=1).max() for vertices in around]
        return float(max([self.reach, *far]))

    def cast(self, origin: FloatArray, ways: FloatArray) -> Hits:
        """Cast rays.

        Args:
            origin: (3,) [m], or one for each ray (n, 3).
            ways: unit directions (n, 3).
        """
        import open3d as o3d

        scene, normals = self._scene
        lines = np.hstack([np.broadcast_to(origin, ways.shape), ways])
        found = scene.cast_rays(o3d.core.Tensor.from_numpy(lines.astype(np.float32)))
        distance = found["t_hit"].numpy().astype(float)
        normal, met = np.zeros(ways.shape), np.isfinite(distance)
        normal[met] = normals[found["primitive_ids"].numpy()[met].astype(np.int64)]
        behind = np.einsum("ni,ni->n", normal, ways) > 0
        distance[behind], normal[behind] = np.inf, 0.0
        blocked = distances_along(self.geometry.in_view, lines)
        hidden = blocked < distance
        distance[hidden], normal[hidden] = np.inf, 0.0
        return Hits(distance, normal, np.where(hidden, blocked, np.inf))

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Points of the free surface nearest to points (n, 3) [m], and its normals there (n, 3)."""
        import open3d as o3d

        scene, normals = self._scene
        found = scene.compute_closest_points(o3d.core.Tensor.from_numpy(points.astype(np.float32)))
        number = found["primitive_ids"].numpy().astype(np.int64)
        return found["points"].numpy().astype(float), normals[number]

    def seen_from(self, way: FloatArray, distance: float) -> FloatArray:
        """Middle (3,) [m] of the part that a camera sees.

        Args:
            way: unit vector (3,) from the body to the camera.
            distance: of the camera from the body's middle [m].
        """
        origin = self.middle + distance * way
        across = np.linalg.svd(way[None])[2][1:]
        step = np.linspace(-1.0, 1.0, 21) * self.reach
        u, v = (grid.ravel() for grid in np.meshgrid(step, step))
        ways = self.middle + np.stack([u, v], axis=1) @ across - origin
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        hits = self.cast(origin, ways)
        if not hits.met.any():
            return self.middle
        return np.asarray((origin + hits.distance[hits.met, None] * ways[hits.met]).mean(axis=0))
