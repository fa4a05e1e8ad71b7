"""Picture of a surface before and after its repair: three views, its inner side in red."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.figure import new_figure, save_figure

if TYPE_CHECKING:
    from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["surface_picture"]

_PIXELS = 420
"""Pixels along a view's side."""
_OUTER, _INNER, _PAPER = (150, 170, 190), (200, 60, 40), (255, 255, 255)
_VIEWS = {
    "from the side": (0.5, -1.0, 0.45),
    "from the other side": (-0.5, 1.0, 0.45),
    "from below": (0.3, -0.5, -1.0),
}
"""Directions to the eye."""


def surface_picture(before: TriangleSurface, after: TriangleSurface | None, path: Path) -> None:
    """Write a PNG: each surface in three views; what is seen of its inner side is red.

    Args:
        before: the surface as it was read.
        after: the repaired one; None for the first one alone.
        path: of the PNG.
    """
    rows = {"before": before} if after is None else {"before": before, "after": after}
    figure = new_figure(9.0, 3.2 * len(rows), facecolor="white")
    axes = figure.subplots(len(rows), len(_VIEWS), squeeze=False)
    for line, (name, surface) in zip(axes, rows.items(), strict=True):
        for axis, (view, way) in zip(line, _VIEWS.items(), strict=True):
            axis.imshow(_seen(surface, np.array(way)))
            axis.set_axis_off()
            axis.set_title(f"{name}, {view}", fontsize=9)
    figure.suptitle(f"{before.name}: what shows of the inside is red", fontsize=10)
    save_figure(figure, path)


def _seen(surface: TriangleSurface, way: FloatArray) -> np.ndarray:
    """Colours (p, p, 3) of a view along parallel rays from a direction."""
    import open3d as o3d

    way = way / np.linalg.norm(way)
    right = np.cross((0.0, 0.0, 1.0), way)
    right /= np.linalg.norm(right)
    above = np.cross(way, right)
    low, high = surface.vertices.min(axis=0), surface.vertices.max(axis=0)
    middle, radius = (low + high) / 2, 0.52 * float(np.linalg.norm(high - low))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(
        o3d.core.Tensor.from_numpy(((surface.vertices - middle) / radius).astype(np.float32)),
        o3d.core.Tensor.from_numpy(surface.triangles.astype(np.uint32)),
    )
    step = np.linspace(-1.0, 1.0, _PIXELS)
    across, up = np.meshgrid(step, step[::-1])
    rays = np.zeros((_PIXELS, _PIXELS, 6), np.float32)
    rays[..., :3] = across[..., None] * right + up[..., None] * above + 2 * way
    rays[..., 3:] = -way
    hit = scene.cast_rays(o3d.core.Tensor.from_numpy(rays))
    facing = hit["primitive_normals"].numpy() @ way
    colour = np.where(facing[..., None] > 0, _OUTER, _INNER)
    shade = 0.35 + 0.65 * np.abs(facing[..., None])
    there = np.isfinite(hit["t_hit"].numpy())[..., None]
    return np.where(there, colour * shade, _PAPER).astype(np.uint8)
