"""A virtual depth camera: perspective, occluded by tool, shaft and block, noisy, biased, and
dropping points.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.synthetic.scenario.disturbance import Disturbance, rippled
from palpate.synthetic.solver.obstacles import shaft_radius

__all__ = ["DepthCamera", "Scene", "place_camera", "tool_solid"]

TABLE = 0.13
SHAFT_LENGTH = 0.16
QUANTUM = 0.125e-3
EDGE = 4e-3


@dataclass(frozen=True)
class Scene:
    """What stands before the camera, phantom frame.

    Attributes:
        block: vertices (s, 3) [m] and triangles (t, 3).
        centre: (3,) of the tool [m], or None where there is no tool.
        axis: (3,) from the shaft towards the tip.
        radius: of the tool [m].
    """

    block: tuple[FloatArray, Any]
    centre: FloatArray | None
    axis: FloatArray
    radius: float


@dataclass(frozen=True)
class DepthCamera:
    """A camera at `phantom_from_camera`; its pixels are rays (n, 3) with z = 1.

    Attributes:
        bias: (n,) depth error fixed in the image [m].
        sigma: of the depth noise at 0.35 m; it grows with the distance squared [m].
        density: points on the block in one cloud, about.
        on_block: (n,) bool, pixels that see the block at rest.
        disturbances: of the depth.
        offset, scale: a depth z is read as scale z + offset, before what disturbs it [m], [1].
    """

    phantom_from_camera: Transform
    rays: FloatArray
    shape: tuple[int, int]
    bias: FloatArray
    sigma: float
    density: int
    on_block: Any
    disturbances: tuple[Disturbance, ...] = ()
    offset: float = 0.0
    scale: float = 1.0

    def depth(self, scene: Scene) -> tuple[FloatArray, Any]:
        """True depth of each pixel [m], infinite for nothing, and what it sees: 0 block, 1 table,
        more the tool, -1 nothing.
        """
        import open3d as o3d

        cast = o3d.t.geometry.RaycastingScene(nthreads=1)
        into = self.phantom_from_camera.inverse()
        for vertices, triangles in _meshes(scene):
            cast.add_triangles(
                _tensor(into.apply(vertices).astype(np.float32)),
                _tensor(triangles.astype(np.uint32)),
            )
        rays = np.concatenate([np.zeros_like(self.rays), self.rays], axis=1).astype(np.float32)
        hit = cast.cast_rays(_tensor(rays), nthreads=1)
        return hit["t_hit"].numpy().astype(float), hit["geometry_ids"].numpy().astype(np.int32)

    def cloud(self, scene: Scene, rng: np.random.Generator) -> FloatArray:
        """One raw cloud (k, 3), camera frame [m]: block, table, tool and stray points together."""
        depth, what = self.depth(scene)
        depth = self._flying(depth, rng)
        keep = rng.random(len(depth)) < self._chance(what)
        seen = np.nonzero(keep & np.isfinite(depth))[0]
        z = (
            rippled(self.disturbances, self.scale * depth[seen] + self.offset)
            + self.bias[seen]
            + rng.normal(size=len(seen)) * self.sigma * (depth[seen] / 0.35) ** 2
        )
        stray = rng.random(len(seen)) < 0.006
        z[stray] *= rng.uniform(0.75, 1.3, stray.sum())
        z = np.round(z / QUANTUM) * QUANTUM
        return self.rays[seen] * z[:, None]

    def _chance(self, what: Any) -> FloatArray:
        """How likely each pixel is kept: the table is thinned, so that most of a cloud is block and
        tool.
        """
        on_block = min(1.0, self.density / max(int(self.on_block.sum()), 1))
        others = min(1.0, 0.45 * self.density / max(int((~self.on_block).sum()), 1))
        return np.where(what == 1, others, on_block)

    def _flying(self, depth: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Pixels at an edge that mix what lies before and behind it."""
        image = np.where(np.isfinite(depth), depth, np.nan).reshape(self.shape)
        mixed = image.copy()
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            other = np.roll(image, step, axis)
            at_edge = (np.abs(other - image) > EDGE) & (rng.random(self.shape) < 0.12)
            mixed[at_edge] = (image + (other - image) * rng.random(self.shape))[at_edge]
        return np.where(np.isfinite(mixed), mixed, np.inf).ravel()


def place_camera(
    rng: np.random.Generator,
    size: tuple[float, float, float],
    block: tuple[FloatArray, Any],
    seen: FloatArray,
    density: int,
    sigma: float,
) -> DepthCamera:
    """A camera 0.3 to 0.42 m away, above to one side, so that the top and the two sides with the
    signs `seen` are visible.
    """
    away = rng.uniform(0.30, 0.42)
    turn, up = np.deg2rad(rng.uniform(35, 58)), np.deg2rad(rng.uniform(40, 54))
    towards = np.array(
        [seen[0] * np.cos(up) * np.cos(turn), seen[1] * np.cos(up) * np.sin(turn), np.sin(up)]
    )
    target = np.array([0.0, 0.0, size[2] / 2]) + rng.uniform(-5e-3, 5e-3, 3)
    forward = -towards
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(forward, right), forward], axis=1)
    roll = Rotation.from_rotvec(np.array([0.0, 0.0, rng.uniform(-0.05, 0.05)])).as_matrix()
    pose = Transform(rotation @ roll, target + away * towards)
    return _with_pixels(pose, size, block, density, sigma, rng)


def _with_pixels(
    pose: Transform,
    size: tuple[float, float, float],
    block: tuple[FloatArray, Any],
    density: int,
    sigma: float,
    rng: np.random.Generator,
) -> DepthCamera:
    """Choose the pitch of the pixels so that the block covers 1.3 times the wanted points, over a
    window with the table around.
    """
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0.0, 1.0)]) * (
        size[0],
        size[0],
        1.4 * size[2],
    )
    flat = pose.inverse().apply(corners)
    flat = flat[:, :2] / flat[:, 2:]
    low, high = flat.min(axis=0), flat.max(axis=0)
    scene = Scene(block, None, np.array([0.0, 0.0, -1.0]), 1.0)
    pitch = float(np.sqrt(np.prod(high - low) / 20_000))
    camera = _grid(pose, low, high, pitch, sigma, density)
    share = (camera.depth(scene)[1] == 0).mean()
    pitch = float(np.sqrt(np.prod(high - low) * share / (1.3 * density)))
    camera = _grid(pose, low, high, pitch, sigma, density)
    bias = _smooth(camera.rays[:, :2], float(np.max(high - low)), rng)
    return DepthCamera(
        pose, camera.rays, camera.shape, bias, sigma, density, camera.depth(scene)[1] == 0
    )


def _grid(
    pose: Transform, low: FloatArray, high: FloatArray, pitch: float, sigma: float, density: int
) -> DepthCamera:
    x, y = np.arange(low[0], high[0], pitch), np.arange(low[1], high[1], pitch)
    rays = np.stack([*np.meshgrid(x, y), np.ones((len(y), len(x)))], axis=-1).reshape(-1, 3)
    return DepthCamera(
        pose,
        rays,
        (len(y), len(x)),
        np.zeros(len(rays)),
        sigma,
        density,
        np.zeros(len(rays), dtype=bool),
    )


def _smooth(
    places: FloatArray, width: float, rng: np.random.Generator, amplitude: float = 0.3e-3
) -> FloatArray:
    """A random smooth field (n,) of the given root mean square [m], with waves of a third of the
    image and longer.
    """
    waves = rng.normal(size=(24, 2)) * 2 * np.pi * 1.3 / width
    phases, heights = rng.uniform(0, 2 * np.pi, 24), rng.normal(size=24)
    field = np.cos(places @ waves.T + phases) @ heights
    return np.asarray(field * amplitude / np.sqrt(np.mean(field**2)))


def tool_solid(centre: FloatArray, axis: FloatArray, radius: float) -> list[tuple[FloatArray, Any]]:
    """Triangles of the ball and of the shaft that rises from it, away from the tip."""
    import open3d as o3d

    ball = o3d.geometry.TriangleMesh.create_sphere(radius, resolution=16)
    shaft = o3d.geometry.TriangleMesh.create_cylinder(
        shaft_radius(radius), SHAFT_LENGTH, resolution=16, split=1
    )
    turn = Rotation.align_vectors(-axis[None], [[0.0, 0.0, 1.0]])[0].as_matrix()
    rod = (np.asarray(shaft.vertices) + np.array([0.0, 0.0, SHAFT_LENGTH / 2])) @ turn.T + centre
    return [
        (np.asarray(ball.vertices) + centre, np.asarray(ball.triangles)),
        (rod, np.asarray(shaft.triangles)),
    ]


def _tensor(array: Any) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))


def _meshes(scene: Scene) -> list[tuple[FloatArray, Any]]:
    """The block first, then the table, then the tool."""
    table = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (TABLE, TABLE, 1.0)
    meshes = [scene.block, (table, np.array([[0, 1, 2], [0, 2, 3]]))]
    return meshes + (
        tool_solid(scene.centre, scene.axis, scene.radius) if scene.centre is not None else []
    )
