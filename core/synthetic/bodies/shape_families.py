"""Families of soft phantoms with random proportions: organs, pads and a block with a groove.

An organ is star-shaped about the middle of its base: a function gives the distance of its surface
in every direction. A pad has a height over every place of its outline.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.setup.free_form.fixed_region import Plane
from palpate.setup.free_form.shape import Shape

__all__ = ["FAMILIES", "draw_shape"]

_CELLS = 36
"""Cells along each side of the grid of which a surface is made."""

Radius = Callable[[FloatArray], FloatArray]


def _star(radius: Radius) -> tuple[FloatArray, IntArray]:
    """Vertices (v, 3) [m] and triangles of a body that is star-shaped about the middle of its base.

    Args:
        radius: distance [m] of the surface in unit directions (n, 3), upwards or level.
    """
    x, y, number, squares = _disc()
    level = np.hypot(x, y)
    turn, rise = np.arctan2(y, x), 0.5 * np.pi * (1.0 - level)

    def surface(up: FloatArray) -> FloatArray:
        unit = np.stack([np.cos(turn) * np.cos(up), np.sin(turn) * np.cos(up), np.sin(up)], axis=1)
        return unit * radius(unit)[:, None]

    base = level[:, None] * surface(np.zeros(len(x)))
    base[:, 2] = 0.0
    # The rim belongs to both.
    own = np.where(level > 1.0 - 1e-9, number, number + len(x))
    vertices = np.concatenate([surface(rise), base])
    vertices[: len(x), 2][level > 1.0 - 1e-9] = 0.0
    triangles = np.concatenate([squares, own[squares[:, ::-1]]])
    used, index = np.unique(triangles, return_inverse=True)
    return vertices[used], index.reshape(-1, 3).astype(np.int64)


def _disc() -> tuple[FloatArray, FloatArray, IntArray, IntArray]:
    """Places x, y (n,) of a grid over the unit disc [1], their numbers and triangles (t, 3).

    Concentric squares become concentric circles (Shirley and Chiu 1997).
    """
    u, v, triangles = _square()
    far, long = np.maximum(np.abs(u), np.abs(v)), np.maximum(np.hypot(u, v), 1e-12)
    return far * u / long, far * v / long, np.arange(len(u)), triangles


def _square() -> tuple[FloatArray, FloatArray, IntArray]:
    """Places (n,), (n,) of a grid over the square from -1 to 1, and its triangles (t, 3)."""
    step = np.linspace(-1.0, 1.0, _CELLS + 1)
    u, v = (grid.ravel() for grid in np.meshgrid(step, step, indexing="ij"))
    number = np.arange(len(u)).reshape(_CELLS + 1, _CELLS + 1)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    # The diagonals point outwards in every quarter, so that the corners have no flat triangle.
    far = np.arange(_CELLS) >= _CELLS // 2
    way = far[:, None] == far
    first = np.where(way[..., None], np.stack([a, b, c], -1), np.stack([a, b, d], -1))
    second = np.where(way[..., None], np.stack([a, c, d], -1), np.stack([b, c, d], -1))
    return u, v, np.concatenate([first.reshape(-1, 3), second.reshape(-1, 3)])


def _ellipsoid(directions: FloatArray, axes: FloatArray) -> FloatArray:
    return np.asarray(1.0 / np.linalg.norm(directions / axes, axis=1))


def _waves(directions: FloatArray, random: np.random.Generator, size: float) -> FloatArray:
    """Smooth random waves over the sphere (n,), about `size` high [1]."""
    total = np.zeros(len(directions))
    for _ in range(6):
        way = random.normal(size=3)
        total += np.cos(random.uniform(1.5, 3.5) * directions @ way + random.uniform(0, 6.3))
    return np.asarray(size * total / np.sqrt(3.0))


def _dome(random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    axes = np.array([random.uniform(28, 45), random.uniform(20, 27), random.uniform(18, 32)])
    return _star(lambda unit: _ellipsoid(unit, 1e-3 * axes))


def _liver(random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    axes = 1e-3 * np.array([random.uniform(45, 60), random.uniform(28, 38), random.uniform(22, 30)])
    thin, notch = random.uniform(0.25, 0.45), random.uniform(-0.4, 0.1)
    seed = int(random.integers(10**9))

    def radius(unit: FloatArray) -> FloatArray:
        along = unit[:, 0]
        lobes = 1.0 - thin * np.clip(along, 0.0, 1.0) * unit[:, 2].clip(0.0)
        front = 1.0 / (1.0 + np.exp((unit[:, 1] - 0.3) / 0.1))
        lobes -= 0.18 * np.exp(-(((along - notch) / 0.18) ** 2)) * front
        waves = _waves(unit, np.random.default_rng(seed), 0.05)
        return np.asarray(_ellipsoid(unit, axes) * (lobes + waves))

    return _star(radius)


def _kidney(random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    axes = 1e-3 * np.array([random.uniform(42, 55), random.uniform(24, 30), random.uniform(20, 26)])
    deep, other = random.uniform(0.25, 0.4), random.uniform(0.8, 0.95)

    def radius(unit: FloatArray) -> FloatArray:
        hilum = deep * np.exp(-((unit[:, 0] / 0.35) ** 2)) * np.clip(unit[:, 1], 0.0, 1.0)
        smaller = 1.0 - (1.0 - other) * np.clip(unit[:, 0], 0.0, 1.0) ** 2
        return np.asarray(_ellipsoid(unit, axes) * (1.0 - hilum) * smaller)

    return _star(radius)


def _breast(random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    axes = 1e-3 * np.array([random.uniform(40, 52), random.uniform(36, 46), random.uniform(28, 40)])
    apex = np.array([random.uniform(0.2, 0.45), random.uniform(-0.2, 0.2), 0.0])
    apex[2] = np.sqrt(1.0 - apex[0] ** 2 - apex[1] ** 2)
    sag, tip = random.uniform(0.1, 0.2), random.uniform(0.08, 0.14)

    def radius(unit: FloatArray) -> FloatArray:
        near = unit @ apex
        bulge = sag * np.clip(near, 0.0, 1.0) ** 3 + tip * np.exp(-(1.0 - near) / 0.008)
        return np.asarray(_ellipsoid(unit, axes) * (1.0 + bulge))

    return _star(radius)


def _pad(
    x: FloatArray,
    y: FloatArray,
    top: IntArray,
    height: Callable[[FloatArray, FloatArray], FloatArray],
) -> tuple[FloatArray, IntArray]:
    """Vertices and triangles of a body with steep sides.

    Args:
        x: of a grid of places in the plane (n,) [m], from `_square` or `_disc`.
        y: the same.
        top: its triangles (t, 3).
        height: of the top over places in the plane [m].
    """
    count = len(x)
    number = np.arange(count).reshape(_CELLS + 1, _CELLS + 1)
    rim = np.concatenate([number[:, 0], number[-1, 1:], number[-2::-1, -1], number[0, -2::-1]])
    ends = np.stack([rim[:-1], rim[1:]], axis=1)
    sides = np.concatenate(
        [
            np.column_stack([ends[:, 0] + count, ends[:, 1] + count, ends[:, 1]]),
            np.column_stack([ends[:, 0] + count, ends[:, 1], ends[:, 0]]),
        ]
    )
    raised = np.column_stack([x, y, height(x, y)])
    vertices = np.concatenate([raised, raised * [1.0, 1.0, 0.0]])
    return vertices, np.concatenate([top, top[:, ::-1] + count, sides]).astype(np.int64)


def _cylinder(random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    radius, tall = 1e-3 * random.uniform(25, 40), 1e-3 * random.uniform(15, 30)
    tilt = random.uniform(0.08, 0.2)

    x, y, _, triangles = _disc()
    return _pad(radius * x, radius * y, triangles, lambda x, y: tall + tilt * x + 0.0 * y)


def _grooved(random: np.random.Generator) -> tuple[FloatArray, IntArray]:
    half = 1e-3 * np.array([random.uniform(30, 40), random.uniform(18, 26)])
    tall, deep, wide = (
        1e-3 * random.uniform(low, high) for low, high in ((22, 34), (4, 8), (4, 8))
    )
    place, turn = random.uniform(-0.5, 0.5) * half[0], random.uniform(0.2, 0.6)
    u, v, triangles = _square()
    return _pad(
        half[0] * u,
        half[1] * v,
        triangles,
        lambda x, y: tall - deep * np.exp(-(((x - place - turn * y) / wide) ** 2)),
    )


FAMILIES: Mapping[str, Callable[[np.random.Generator], tuple[FloatArray, IntArray]]] = {
    "dome": _dome,
    "liver": _liver,
    "kidney": _kidney,
    "breast": _breast,
    "cylinder": _cylinder,
    "grooved": _grooved,
}
"""Functions that draw vertices (v, 3) [m] and triangles (t, 3) of a body, by family."""


def draw_shape(family: str, seed: int) -> Shape:
    """Return a body of a family, held at its base.

    Args:
        family: one of FAMILIES.
        seed: of its proportions.
    """
    vertices, triangles = FAMILIES[family](np.random.default_rng(seed))
    return Shape(vertices, triangles, Plane(), family)
