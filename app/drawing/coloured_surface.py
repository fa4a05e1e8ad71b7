"""Surfaces as figures, in bands of colours for a quantity or in one light colour."""

from __future__ import annotations

import numpy as np

from palpate.app.drawing import colours
from palpate.app.drawing.figures import Figure, SurfaceFigure, float32
from palpate.app.drawing.surface_bands import IntArray
from palpate.app.drawing.view import Quantity
from palpate.foundation.arrays import FloatArray

__all__ = ["banded_surface", "light_surface"]


def banded_surface(
    name: str,
    vertices: FloatArray,
    faces: IntArray,
    values: FloatArray,
    quantity: Quantity,
    limit: float,
    opacity: float,
) -> dict[str, Figure]:
    """One figure for each colour that occurs.

    Args:
        name: beginning of the figures' names.
        vertices: (n, 3) [m].
        faces: (m, 3); the colour shows the mean over a triangle.
        values: (n,) at the vertices.
        quantity: shown by the colours.
        limit: end of the scale.
        opacity: 0 to 1.
    """
    signed = quantity == "error"
    shades = colours.SIGNED if signed else colours.SEQUENTIAL
    means = values[faces].mean(axis=1)
    band = colours.band_of(means, limit) if signed else colours.step_of(means, limit)
    meshes: dict[str, Figure] = {}
    for number in np.unique(band):
        used, turned = np.unique(faces[band == number], return_inverse=True)
        unseen = number == len(shades)
        label = f"{name}-unseen" if unseen else f"{name}-{number:02d}"
        shade = colours.UNSEEN if unseen else shades[number]
        meshes[label] = SurfaceFigure(
            float32(vertices[used]), turned.reshape(-1, 3), shade, opacity
        )
    return meshes


def light_surface(
    vertices: FloatArray, faces: IntArray, colour: tuple[int, int, int], opacity: float
) -> SurfaceFigure:
    """A cut face in a lighter shade of a model's colour, distinct from the outer surface."""
    light = tuple(round(0.45 * part + 0.55 * 255) for part in colour)
    return SurfaceFigure(float32(vertices), faces, (light[0], light[1], light[2]), opacity)
