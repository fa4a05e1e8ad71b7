"""Figures of a picture: plain arrays with colours, in the phantom frame [m]."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from palpate.app.drawing.surface_bands import IntArray
from palpate.foundation.arrays import FloatArray

__all__ = [
    "CloudFigure",
    "ColourArray",
    "Figure",
    "LabelFigure",
    "LinesFigure",
    "PointArray",
    "Rgb",
    "SurfaceFigure",
    "ToolFigure",
    "checksum",
]

PointArray = np.ndarray[Any, np.dtype[np.float32]]
ColourArray = np.ndarray[Any, np.dtype[np.uint8]]
Rgb = tuple[int, int, int]
Place = tuple[float, float, float]
HERE: Place = (0.0, 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SurfaceFigure:
    """A surface of one colour: vertices (n, 3) [m], faces (m, 3).

    All figures have `at`, their shift [m].
    """

    vertices: PointArray
    faces: IntArray
    colour: Rgb
    opacity: float = 1.0
    at: Place = HERE


@dataclass(frozen=True, eq=False)
class CloudFigure:
    """Points (n, 3) [m] of one colour, or with a colour (n, 3) for each; `size` of a point [m], as
    usual if None.
    """

    points: PointArray
    colour: Rgb | ColourArray
    size: float | None = None
    at: Place = HERE


@dataclass(frozen=True, eq=False)
class LinesFigure:
    """Segments (k, 2, 3) [m] of one colour, or with a colour (k, 2, 3) at each end; `width` in
    pixels.
    """

    segments: PointArray
    colour: Rgb | ColourArray
    width: float = 1.2
    at: Place = HERE


@dataclass(frozen=True, eq=False)
class ToolFigure:
    """A sphere with a short shaft, upwards or along `axis` (3,); centre (3,) and radius [m]."""

    centre: FloatArray
    radius: float
    opacity: float = 1.0
    at: Place = HERE
    axis: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class LabelFigure:
    """Text at a place (3,) [m]."""

    text: str
    place: FloatArray
    at: Place = HERE


Figure = SurfaceFigure | CloudFigure | LinesFigure | ToolFigure | LabelFigure


def checksum(frame: int, figures: Mapping[str, Figure]) -> str:
    """A short digest of all arrays of a picture."""
    digest = hashlib.sha256(str(frame).encode())
    for name in sorted(figures):
        digest.update(name.encode())
        for field in fields(figures[name]):
            value = getattr(figures[name], field.name)
            digest.update(
                np.ascontiguousarray(value, dtype=np.float32).tobytes()
                if isinstance(value, np.ndarray)
                else repr(value).encode()
            )
    return digest.hexdigest()[:16]


def float32(values: Any) -> PointArray:
    """Values as a contiguous array of single precision, as figures store them."""
    return np.ascontiguousarray(values, dtype=np.float32)
