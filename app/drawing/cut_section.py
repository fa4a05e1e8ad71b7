"""Sections through a body: the remaining surface, and the cut face."""

from __future__ import annotations

import numpy as np

from palpate.app.drawing.surface_bands import FineSurface, IntArray, lattice
from palpate.app.drawing.view import Section
from palpate.foundation.arrays import FloatArray

__all__ = ["clipped", "cut_face", "depth_inside"]

CAP_SPACING = 1.0e-3
"""Approximate spacing of the points on a cut face [m]."""
_TOUCHES = 1e-9
"""Points closer to an outline than this lie on it [m]."""


def depth_inside(section: Section, places: FloatArray) -> FloatArray:
    """Distance of places (..., 3) [m] at rest from the cutting plane [m]; negative where they are
    cut away.
    """
    away = np.asarray(places, dtype=float)[..., "xyz".index(section.axis)] - section.at
    return np.asarray(away if section.flip else -away)


def clipped(surface: FineSurface, rest: FloatArray, section: Section) -> FineSurface:
    """The remaining part of a surface; triangles across the plane are split along it.

    New points are weighted means of the same coarse vertices (v, 3) [m], so that they move with the
    material.
    """
    return _where(surface, depth_inside(section, surface.spread(rest)))


def _where(surface: FineSurface, inside: FloatArray) -> FineSurface:
    """The part of a surface in which a linear function, with values (n,) at its points, is not
    negative.
    """
    good = inside >= 0
    count = good[surface.faces].sum(axis=1)
    whole = surface.faces[count == 3]
    crossed = surface.faces[(count > 0) & (count < 3)]
    # Rotate each triangle so that the corner that is alone on its side comes first.
    alone = np.where(
        good[crossed].sum(axis=1) == 1, good[crossed].argmax(axis=1), good[crossed].argmin(axis=1)
    )
    turned = np.take_along_axis(crossed, (alone[:, None] + np.arange(3)) % 3, axis=1)
    a, b, c = turned.T
    on_ab, on_ac = len(inside) + np.arange(len(a)), len(inside) + len(a) + np.arange(len(a))
    tip = good[a]
    faces = [
        whole,
        np.stack([a, on_ab, on_ac], axis=1)[tip],
        np.stack([on_ab, b, c], axis=1)[~tip],
        np.stack([on_ab, c, on_ac], axis=1)[~tip],
    ]
    corners, weights = _between(surface, inside, np.concatenate([a, a]), np.concatenate([b, c]))
    empty = np.zeros_like(surface.weights)
    return FineSurface(
        np.concatenate([np.hstack([surface.corners, surface.corners]), corners]),
        np.concatenate([np.hstack([surface.weights, empty]), weights]),
        np.concatenate(faces),
    )


def _between(
    surface: FineSurface, inside: FloatArray, one: IntArray, other: IntArray
) -> tuple[IntArray, FloatArray]:
    """Intersections of edges with the plane, as weighted means of the edges' corners."""
    span = inside[one] - inside[other]
    share = (inside[one] / np.where(span == 0, 1.0, span))[:, None]
    weights = np.hstack([surface.weights[one] * (1 - share), surface.weights[other] * share])
    return np.hstack([surface.corners[one], surface.corners[other]]), weights


def cut_face(
    vertices: FloatArray, faces: IntArray, section: Section
) -> tuple[FloatArray, IntArray] | None:
    """Places (n, 3) [m] at rest and triangles (m, 3) of the cut face of a body.

    A grid over the plane is cut along the body's outline in it. None where the plane misses it.

    Args:
        vertices: (v, 3) of the closed surface [m].
        faces: (t, 3) of the closed surface.
        section: the plane.
    """
    axis = "xyz".index(section.axis)
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    if not low[axis] < section.at < high[axis]:
        return None
    across = [other for other in range(3) if other != axis]
    outline = _outline(vertices, faces, axis, section.at)[:, :, across]
    if not len(outline):
        return None
    start, end = outline.min(axis=(0, 1)), outline.max(axis=(0, 1))
    steps = [max(2, int(np.ceil(length / CAP_SPACING)) + 1) for length in end - start]
    axes = (np.linspace(a, b, n) for a, b, n in zip(start, end, steps, strict=True))
    flat = np.stack([part.ravel() for part in np.meshgrid(*axes, indexing="ij")], axis=1)
    rows = np.arange(len(flat))[:, None]
    grid = FineSurface(rows, np.ones(rows.shape), lattice(steps[0], steps[1]))
    part = _where(grid, _depth_in_outline(flat, outline))
    used, turned = np.unique(part.faces, return_inverse=True)
    places = np.full((len(used), 3), float(section.at))
    places[:, across] = part.spread(flat)[used]
    return (places, turned.reshape(-1, 3)) if len(used) else None


def _outline(vertices: FloatArray, faces: IntArray, axis: int, at: float) -> FloatArray:
    """Segments (s, 2, 3) [m] in which the triangles meet a plane across an axis."""
    above = vertices[:, axis] > at
    count = above[faces].sum(axis=1)
    crossed = faces[(count > 0) & (count < 3)]
    side = above[crossed]
    alone = np.where(side.sum(axis=1) == 1, side.argmax(axis=1), side.argmin(axis=1))
    tip, one, other = np.take_along_axis(crossed, (alone[:, None] + np.arange(3)) % 3, axis=1).T
    ends = []
    for far in (one, other):
        share = (at - vertices[tip, axis]) / (vertices[far, axis] - vertices[tip, axis])
        ends.append(vertices[tip] + share[:, None] * (vertices[far] - vertices[tip]))
    return np.stack(ends, axis=1)


def _depth_in_outline(points: FloatArray, outline: FloatArray) -> FloatArray:
    """Distance (n,) [m] of points (n, 2) to closed lines of segments (s, 2, 2), negative outside;
    a point is inside if a ray from it crosses the lines an odd number of times.
    """
    inside, nearest = np.zeros(len(points), dtype=bool), np.full(len(points), np.inf)
    for begin, end in outline:
        along, away = end - begin, points - begin
        share = np.clip(away @ along / max(float(along @ along), 1e-30), 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(away - share[:, None] * along, axis=1))
        spans = (begin[1] > points[:, 1]) != (end[1] > points[:, 1])
        if spans.any():
            meets = begin[0] + (points[:, 1] - begin[1]) / (end[1] - begin[1]) * along[0]
            inside ^= spans & (points[:, 0] < meets)
    nearest[nearest < _TOUCHES] = 0.0
    return np.where(inside, nearest, -nearest)
