"""Steps that close a surface: by a plane at its base, and across small holes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import MeshError
from palpate.setup.surface_repair.ear_clipping import clip_ears
from palpate.setup.surface_repair.planar_cap import cap_rims
from palpate.setup.surface_repair.surface_topology import SurfaceEdges
from palpate.setup.surface_repair.triangle_surface import TriangleSurface

__all__ = ["CloseBase", "FillHoles"]

_ON_PLANE = 1e-7
"""A vertex so near to the plane lies in it [m]."""


@dataclass(frozen=True)
class CloseBase:
    """Close the body by a horizontal plane: what lies below is cut off, and walls go down to it
    from a rim above.

    Attributes:
        height: of the plane over the lowest point [m].
    """

    height: float = 0.0
    title = "close base"
    unmoved = ""

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Close the base; MeshError where no rim reaches the plane."""
        level = float(surface.vertices[:, 2].min()) + self.height
        cut = _above(surface, level)
        rims = [rim for rim in SurfaceEdges(cut.triangles).rims if _reaches(cut, rim, level)]
        if not rims:
            raise MeshError(
                f"{surface.name}: {_no_rim(cut, level)}: use --base-height MM, the plane's height "
                "over the lowest point, or --fill-holes MM",
                file=surface.name,
                level=level,
            )
        vertices, triangles, feet, tall = cut.vertices, [cut.triangles], [], 0.0
        for rim in rims:
            tall = max(tall, float(vertices[rim, 2].max()) - level)
            vertices, walls, foot = _walls(vertices, rim, level)
            triangles.append(walls)
            feet.append(foot)
        cap = cap_rims(vertices[:, :2], feet)
        if cap is None:
            raise MeshError(
                f"{surface.name}: the {len(rims)} rim(s) of the base cross seen from above, so "
                f"that a plane does not close them: cut above them, with --base-height "
                f"{1e3 * (self.height + tall):.4g}, or rebuild the surface with --rebuild MM",
                file=surface.name,
                rims=len(rims),
            )
        closed = cut.of(np.concatenate([*triangles, cap]), vertices)
        return closed, (
            f"plane at z = {1e3 * level:.4g} mm: {len(rims)} rim(s) closed, cut off "
            f"{1e3 * self.height:.4g} mm, walls up to {1e3 * tall:.4g} mm"
        )


def _above(surface: TriangleSurface, level: float) -> TriangleSurface:
    """The part above a height [m], without triangles that lie in the plane; vertices near it are
    put into it.
    """
    vertices = surface.vertices.copy()
    vertices[np.abs(vertices[:, 2] - level) < _ON_PLANE, 2] = level
    height = vertices[:, 2] - level
    below = height[surface.triangles] < 0
    # Each triangle begins with its only corner on one side of the plane.
    lone = np.where(below.sum(axis=1) == 2, (~below).argmax(axis=1), below.argmax(axis=1))
    order = (lone[:, None] + np.arange(3)) % 3
    turned = np.take_along_axis(surface.triangles, order, axis=1)
    one, two = turned[below.sum(axis=1) == 1], turned[below.sum(axis=1) == 2]
    ends = np.concatenate([one[:, [0, 1]], one[:, [0, 2]], two[:, [0, 1]], two[:, [0, 2]]])
    edges, number = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
    share = height[edges[:, 0]] / (height[edges[:, 0]] - height[edges[:, 1]])
    places = vertices[edges[:, 0]] + share[:, None] * (
        vertices[edges[:, 1]] - vertices[edges[:, 0]]
    )
    places[:, 2] = level
    # An edge that ends in the plane is cut at that end.
    touching = height[edges] == 0
    cut = np.where(touching.any(axis=1), edges[np.arange(len(edges)), touching.argmax(axis=1)],
                   len(vertices) + np.arange(len(edges)))[number.ravel()]  # fmt: skip
    (a, b), (c, d) = (np.split(part, 2) for part in np.split(cut, [2 * len(one)]))
    triangles = np.concatenate([
        surface.triangles[~below.any(axis=1)],
        np.column_stack([a, one[:, 1], one[:, 2]]),
        np.column_stack([a, one[:, 2], b]),
        np.column_stack([two[:, 0], c, d]),
    ])  # fmt: skip
    vertices = np.concatenate([vertices, places])
    flat = (vertices[triangles, 2] <= level).all(axis=1)
    collapsed = (np.diff(np.sort(triangles, axis=1), axis=1) == 0).any(axis=1)
    return surface.of(triangles[~flat & ~collapsed], vertices)


def _reaches(surface: TriangleSurface, rim: IntArray, level: float) -> bool:
    return bool(surface.vertices[rim, 2].min() <= level)


def _no_rim(surface: TriangleSurface, level: float) -> str:
    rims = SurfaceEdges(surface.triangles).rims
    if not rims:
        return f"nothing is open at z = {1e3 * level:.4g} mm"
    low = min(float(surface.vertices[rim, 2].min()) for rim in rims)
    return (
        f"no rim reaches the plane at z = {1e3 * level:.4g} mm, the lowest of {len(rims)} begins "
        f"at {1e3 * low:.4g} mm"
    )


def _walls(
    vertices: FloatArray, rim: IntArray, level: float
) -> tuple[FloatArray, IntArray, IntArray]:
    """Walls from a rim (k,) down to a height [m].

    Returns:
        vertices with those of the foot, triangles (w, 3) of the walls, and the foot (k,), in the
        rim's direction.
    """
    foot, high = rim.copy(), vertices[rim, 2] > level
    foot[high] = len(vertices) + np.arange(high.sum())
    below = vertices[rim[high]].copy()
    below[:, 2] = level
    a, b, c, d = rim, np.roll(rim, -1), np.roll(foot, -1), foot
    walls = np.concatenate([np.column_stack([b, a, d]), np.column_stack([b, d, c])])
    real = (np.diff(np.sort(walls, axis=1), axis=1) != 0).all(axis=1)
    return np.concatenate([vertices, below]), walls[real], foot


@dataclass(frozen=True)
class FillHoles:
    """Close holes up to a size by triangles between the vertices of their rims.

    Attributes:
        width: largest extent of a rim that is filled [m].
    """

    width: float
    title = "fill holes"
    unmoved = ""

    def __call__(self, surface: TriangleSurface) -> tuple[TriangleSurface, str]:
        """Fill the holes."""
        filled, widest, left = [], 0.0, 0
        for rim in SurfaceEdges(surface.triangles).rims:
            places = surface.vertices[rim[::-1]]
            width = float(np.linalg.norm(np.ptp(places, axis=0)))
            cap = clip_ears(_flattened(places)) if width <= self.width else None
            if cap is None:
                left += 1
                continue
            filled.append(rim[::-1][cap])
            widest = max(widest, width)
        whole = surface.of(np.concatenate([surface.triangles, *filled]))
        said = f"filled {len(filled)} hole(s) up to {1e3 * widest:.4g} mm wide"
        return whole, said + (f", left {left} that are wider or twisted" if left else "")


def _flattened(places: FloatArray) -> FloatArray:
    """A ring (k, 3) seen along its normal (Newell), counter-clockwise (k, 2)."""
    centred = places - places.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    length = float(np.linalg.norm(normal))
    normal = normal / length if length > 0 else np.array([0.0, 0.0, 1.0])
    across = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    across /= np.linalg.norm(across)
    return np.column_stack([centred @ across, centred @ np.cross(normal, across)])
