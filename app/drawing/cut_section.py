"""Sections through a block: the remaining surface, and the cut face."""

from __future__ import annotations

import numpy as np

from palpate.app.drawing.surface_bands import FineSurface, IntArray, lattice
from palpate.app.drawing.view import Section
from palpate.foundation.arrays import FloatArray

__all__ = ["clipped", "cut_face", "depth_inside"]

CAP_SPACING = 1.2e-3
"""Approximate spacing of the points on a cut face [m]."""


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
    inside = depth_inside(section, surface.spread(rest))
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
    low: FloatArray, high: FloatArray, section: Section
) -> tuple[FloatArray, IntArray] | None:
    """Places (n, 3) [m] at rest and triangles (m, 3) of the cut face of a block.

    `low` and `high` are the corners (3,) of the block. None where the plane misses it.
    """
    axis = "xyz".index(section.axis)
    if not low[axis] < section.at < high[axis]:
        return None
    across = [other for other in range(3) if other != axis]
    steps = [max(2, int(np.ceil((high[other] - low[other]) / CAP_SPACING)) + 1) for other in across]
    grid = np.meshgrid(
        *(np.linspace(low[other], high[other], n) for other, n in zip(across, steps, strict=True)),
        indexing="ij",
    )
    places = np.full((grid[0].size, 3), float(section.at))
    places[:, across[0]], places[:, across[1]] = grid[0].ravel(), grid[1].ravel()
    return places, lattice(steps[0], steps[1])
