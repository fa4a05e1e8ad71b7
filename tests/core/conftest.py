"""A depth camera looking at a block on a table, by ray casting: each point comes with what it
really belongs to.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform

SIZE = (0.0687, 0.0393, 0.0358)
TABLE, BLOCK, SPHERE, SHAFT, STRAY = range(5)


@dataclass(frozen=True)
class View:
    """A cloud (n, 3), camera frame, the label of each point, and the true phantom_from_camera."""

    cloud: FloatArray
    label: Any
    pose: Transform


@dataclass(frozen=True, kw_only=True)
class Scene:
    """What the camera looks at; lengths [m], phantom frame."""

    size: tuple[float, float, float] = SIZE
    camera: tuple[float, float, float] = (-0.19, -0.21, 0.26)
    tool: tuple[float, float, float] | None = None
    shaft: tuple[float, float, float] = (0.0, 0.0, 1.0)
    tool_radius: float = 0.005
    shaft_radius: float = 0.004
    noise: float = 7.0e-4
    bias: float = 3.0e-4
    strays: int = 25
    pixels: int = 110

    def look(self, seed: int) -> View:
        """One frame: white noise and a smooth bias along the line of sight, strays anywhere in
        front of the camera.
        """
        rng = np.random.default_rng(seed)
        pose = _looking_at(
            np.array(self.camera),
            np.array([0.0, 0.0, self.size[2] / 2]),
            roll=rng.uniform(-0.5, 0.5),
        )
        rays = _rays(self.pixels)
        sight = pose.rotate(rays)
        depth, label = self._cast(pose.translation, sight)
        seen = np.isfinite(depth)
        rays, depth, label = rays[seen], depth[seen], label[seen]
        depth = (
            depth
            + self.noise * rng.standard_normal(len(depth))
            + self.bias * _smooth(rays * depth.mean(), rng)
        )
        stray = rng.choice(len(depth), self.strays, replace=False)
        depth[stray] *= rng.uniform(0.6, 1.1, self.strays)
        label[stray] = STRAY
        return View(rays * depth[:, None], label, pose)

    def surface(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Height of the top, pressed in under the tool so that it never reaches into the sphere."""
        top = np.full_like(x, self.size[2])
        if self.tool is None:
            return top
        away = np.hypot(x - self.tool[0], y - self.tool[1])
        depth = max(0.0, self.size[2] - (self.tool[2] - self.tool_radius))
        dented = top - depth / (1 + (away / 0.006) ** 2)
        ball = self.tool[2] - np.sqrt(np.maximum(self.tool_radius**2 - away**2, 0.0))
        return np.where(away < self.tool_radius, np.minimum(dented, ball), dented)

    def _cast(self, origin: FloatArray, sight: FloatArray) -> tuple[FloatArray, Any]:
        hits = np.full((len(sight), 4), np.inf)
        hits[:, TABLE] = np.where(
            sight[:, 2] < 0, -origin[2] / np.minimum(sight[:, 2], -1e-9), np.inf
        )
        hits[:, BLOCK] = self._cast_block(origin, sight)
        if self.tool is not None:
            hits[:, SPHERE] = _cast_sphere(origin, sight, np.array(self.tool), self.tool_radius)
            hits[:, SHAFT] = _cast_shaft(
                origin, sight, np.array(self.tool), np.array(self.shaft), self.shaft_radius
            )
        depth = hits.min(axis=1)
        depth[depth > 0.6] = np.inf
        return depth, hits.argmin(axis=1)

    def _cast_block(self, origin: FloatArray, sight: FloatArray) -> FloatArray:
        half = np.array([self.size[0] / 2, self.size[1] / 2, self.size[2] / 2])
        safe = np.where(np.abs(sight) < 1e-12, 1e-12, sight)
        first, second = ((s * half + np.array([0, 0, half[2]]) - origin) / safe for s in (-1, 1))
        enter, leave = np.minimum(first, second).max(axis=1), np.maximum(first, second).min(axis=1)
        hit = enter < leave
        # March from the box's skin to the dented top.
        depth = np.where(hit, enter, np.inf)
        for _ in range(200 if self.tool is not None else 0):
            points = origin + np.where(hit, depth, 0.0)[:, None] * sight
            depth = np.where(
                hit,
                depth
                + np.maximum(points[:, 2] - self.surface(points[:, 0], points[:, 1]), 0.0) * 0.3,
                depth,
            )
            depth = np.where(depth > leave, np.inf, depth)
            hit = np.isfinite(depth)
        return depth


def _looking_at(eye: FloatArray, target: FloatArray, roll: float) -> Transform:
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    c, s = np.cos(roll), np.sin(roll)
    return Transform(np.stack([c * right + s * down, c * down - s * right, forward], axis=1), eye)


def _rays(pixels: int) -> FloatArray:
    tangent = np.tan(np.radians(17.0)) * np.linspace(-1, 1, pixels)
    u, v = (grid.ravel() for grid in np.meshgrid(tangent, tangent))
    rays = np.column_stack([u, v, np.ones_like(u)])
    return np.asarray(rays / np.linalg.norm(rays, axis=1)[:, None])


def _smooth(
    places: FloatArray, rng: np.random.Generator, reach: float = 0.025, waves: int = 200
) -> FloatArray:
    """A smooth random field of unit variance, by random Fourier features."""
    frequency = rng.normal(0, 1 / reach, (3, waves))
    return np.asarray(
        np.sqrt(2 / waves)
        * np.cos(places @ frequency + rng.uniform(0, 2 * np.pi, waves)).sum(axis=1)
    )


def _cast_sphere(
    origin: FloatArray, sight: FloatArray, centre: FloatArray, radius: float
) -> FloatArray:
    along = sight @ (centre - origin)
    inside = radius**2 - ((centre - origin) @ (centre - origin) - along**2)
    return np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0.0)), np.inf)


def _cast_shaft(
    origin: FloatArray, sight: FloatArray, tip: FloatArray, shaft: FloatArray, radius: float
) -> FloatArray:
    across = sight - np.outer(sight @ shaft, shaft)
    start = (origin - tip) - ((origin - tip) @ shaft) * shaft
    a, b, c = (across**2).sum(axis=1), 2 * across @ start, start @ start - radius**2
    inside = b**2 - 4 * a * c
    depth = np.where(inside > 0, (-b - np.sqrt(np.maximum(inside, 0.0))) / (2 * a), np.inf)
    height = (origin - tip) @ shaft + np.where(np.isfinite(depth), depth, 0.0) * (sight @ shaft)
    return np.where((height > 0) & (height < 0.08), depth, np.inf)


@pytest.fixture
def scene() -> type[Scene]:
    """The class, so that a test states what it looks at."""
    return Scene


@pytest.fixture
def measured_datasets() -> list[Path]:
    """Datasets of another solver, beside the checkout or where PALPATE_DATASETS says."""
    folder = Path(
        os.environ.get("PALPATE_DATASETS", Path(__file__).parents[3] / "shared" / "datasets")
    )
    found = sorted(
        path for path in folder.glob("*/") if (folder / f"{path.name}.truth.json").exists()
    )
    if not found:
        pytest.skip(
            f"no datasets with truth in {folder}: set PALPATE_DATASETS to a folder that has some"
        )
    return found
