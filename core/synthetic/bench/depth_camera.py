"""A virtual depth camera with perspective, occlusion, noise, smooth bias and missing points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.synthetic.nuisances.nuisance import Nuisance
from palpate.synthetic.nuisances.nuisance_chain import shaped_tool
from palpate.synthetic.nuisances.random_waves import WAVES, sum_of_waves
from palpate.synthetic.scenario.disturbance import Disturbance, rippled
from palpate.synthetic.solver.obstacles import shaft_radius

__all__ = ["CameraScene", "DepthCamera", "place_camera", "tool_solid"]

TABLE = 0.13
"""Half the edge length of the visible table [m]."""
SHAFT_LENGTH = 0.16
"""Length of the visible shaft [m]."""
QUANTUM = 0.125e-3
"""Resolution of a depth reading [m]."""
_MIDDLE = 0.35
"""Depth in the middle of the camera's range [m]."""
EDGE = 4e-3
"""Step in depth between neighbouring pixels that makes an edge [m]."""


@dataclass(frozen=True)
class CameraScene:
    """Objects in front of the camera, phantom frame.

    Attributes:
        block: vertices (s, 3) [m] and triangles (t, 3).
        centre: (3,) of the tool [m]; None without a tool.
        axis: (3,) unit vector from the shaft towards the tip.
        radius: of the tool [m].
        rest: vertices (s, 3) of the block at rest [m]; None where it is at rest.
        nuisances: of the tool.
    """

    block: tuple[FloatArray, Any]
    centre: FloatArray | None
    axis: FloatArray
    radius: float
    rest: FloatArray | None = None
    nuisances: tuple[Nuisance, ...] = ()


@dataclass(frozen=True)
class DepthCamera:
    """A depth camera.

    Attributes:
        phantom_from_camera: its pose.
        rays: (n, 3) directions of the pixels with z = 1.
        shape: rows and columns of the image.
        bias: (n,) depth error fixed in the image [m].
        sigma: standard deviation of a depth at 0.35 m [m]; it grows with the distance squared.
        density: approximate number of points on the block in one cloud.
        on_block: (n,) bool, pixels that see the block at rest.
        disturbances: of the depth.
        offset: a depth z is read as scale z + offset [m], before disturbances.
        scale: see `offset` [1].
        curvature: what a reading adds for each squared metre from a depth of 0.35 m [1/m].
        sees_table: whether the table gives readings; black cloth gives none.
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
    curvature: float = 0.0
    sees_table: bool = True

    def reading(self, depth: FloatArray) -> FloatArray:
        """Return the readings [m] of true depths [m], before disturbances, bias and noise."""
        read = self.scale * depth + self.offset
        return read + self.curvature * (depth - _MIDDLE) ** 2 if self.curvature else read

    def depth(self, scene: CameraScene) -> tuple[FloatArray, Any]:
        """Cast all rays.

        Returns:
            true depth (n,) [m], infinite without a hit, and the object hit (n,): 0 block, 1 table,
            above 1 tool, -1 none.
        """
        hit = self.cast(scene)
        return hit["t_hit"].numpy().astype(float), hit["geometry_ids"].numpy().astype(np.int32)

    def cast(self, scene: CameraScene) -> Any:
        """Cast all rays; the fields of Open3D's `RaycastingScene.cast_rays`, camera frame."""
        import open3d as o3d

        cast = o3d.t.geometry.RaycastingScene(nthreads=1)
        into = self.phantom_from_camera.inverse()
        for vertices, triangles in _meshes(scene):
            cast.add_triangles(
                _tensor(into.apply(vertices).astype(np.float32)),
                _tensor(triangles.astype(np.uint32)),
            )
        rays = np.concatenate([np.zeros_like(self.rays), self.rays], axis=1).astype(np.float32)
        return cast.cast_rays(_tensor(rays), nthreads=1)

    def cloud(self, scene: CameraScene, rng: np.random.Generator) -> FloatArray:
        """Draw one raw cloud (k, 3) [m], camera frame, of block, table, tool and stray points."""
        depth, what = self.depth(scene)
        depth = self._flying(depth, rng)
        keep = rng.random(len(depth)) < self._chance(what)
        seen = np.nonzero(keep & np.isfinite(depth))[0]
        z = (
            rippled(self.disturbances, self.reading(depth[seen]))
            + self.bias[seen]
            + rng.normal(size=len(seen)) * self.sigma * (depth[seen] / 0.35) ** 2
        )
        stray = rng.random(len(seen)) < 0.006
        z[stray] *= rng.uniform(0.75, 1.3, stray.sum())
        z = np.round(z / QUANTUM) * QUANTUM
        return self.rays[seen] * z[:, None]

    def _chance(self, what: Any) -> FloatArray:
        """Probability (n,) of keeping each pixel; the table is thinned, so that block and tool make
        most of a cloud.
        """
        on_block = min(1.0, self.density / max(int(self.on_block.sum()), 1))
        others = min(1.0, 0.45 * self.density / max(int((~self.on_block).sum()), 1))
        return np.where(what == 1, others if self.sees_table else 0.0, on_block)

    def _flying(self, depth: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Mix depths before and behind an edge in some pixels (flying pixels)."""
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
    """Draw a camera pose 0.3 to 0.42 m away that sees the top and the sides with the signs `seen`.

    Args:
        rng: random generator.
        size: of the block [m].
        block: vertices (s, 3) [m] and triangles (t, 3) at rest.
        seen: (2,) signs of the visible x and y sides.
        density: approximate number of points on the block in one cloud.
        sigma: depth noise at 0.35 m [m].
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
    """Choose the pixel pitch so that the block covers 1.3 x `density` pixels; the image also shows
    the table around it.
    """
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (0.0, 1.0)]) * (
        size[0],
        size[0],
        1.4 * size[2],
    )
    flat = pose.inverse().apply(corners)
    flat = flat[:, :2] / flat[:, 2:]
    low, high = flat.min(axis=0), flat.max(axis=0)
    scene = CameraScene(block, None, np.array([0.0, 0.0, -1.0]), 1.0)
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
    """Draw a smooth random field (n,) [m] of RMS `amplitude`, with wavelengths of a third of the
    image and longer.
    """
    waves = rng.normal(size=(WAVES, 2)) * 2 * np.pi * 1.3 / width
    field = sum_of_waves(places, waves, rng)
    return np.asarray(field * amplitude / np.sqrt(np.mean(field**2)))


def tool_solid(
    centre: FloatArray, axis: FloatArray, radius: float, nuisances: Sequence[Nuisance] = ()
) -> list[tuple[FloatArray, Any]]:
    """Vertices and triangles of the tool's ball and of its shaft, which leaves it opposite to
    `axis`.
    """
    import open3d as o3d

    ball = o3d.geometry.TriangleMesh.create_sphere(radius, resolution=16)
    shaft = o3d.geometry.TriangleMesh.create_cylinder(
        shaft_radius(radius), SHAFT_LENGTH, resolution=16, split=1
    )
    turn = Rotation.align_vectors(-axis[None], [[0.0, 0.0, 1.0]])[0].as_matrix()
    rod = np.asarray(shaft.vertices) + np.array([0.0, 0.0, SHAFT_LENGTH / 2])
    round_ball, *rods = shaped_tool(
        nuisances,
        [
            (np.asarray(ball.vertices), np.asarray(ball.triangles)),
            (rod, np.asarray(shaft.triangles)),
        ],
        radius,
    )
    return [
        (round_ball[0] + centre, round_ball[1]),
        *((vertices @ turn.T + centre, triangles) for vertices, triangles in rods),
    ]


def _tensor(array: Any) -> Any:
    import open3d as o3d

    return o3d.core.Tensor.from_numpy(np.ascontiguousarray(array))


def _meshes(scene: CameraScene) -> list[tuple[FloatArray, Any]]:
    """Meshes of block, table and tool, in this order."""
    table = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * (TABLE, TABLE, 1.0)
    meshes = [scene.block, (table, np.array([[0, 1, 2], [0, 2, 3]]))]
    if scene.centre is None:
        return meshes
    return meshes + tool_solid(scene.centre, scene.axis, scene.radius, scene.nuisances)
