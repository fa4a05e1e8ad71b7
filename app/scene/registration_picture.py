"""The picture of manual registration: cloud, phantom, landmarks, numbered pairs, weak
directions.
"""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, field

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.registration.faces import IndexArray

__all__ = ["Arrow", "Mark", "PairPicture", "middle_of", "pair_colour"]

Rgb = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class Mark:
    """One end of a pair.

    Attributes:
        pair: number of the pair, from 0.
        side: cloud or mesh.
        place: (3,) [m].
        chosen: whether it is selected.
    """

    pair: int
    side: str
    place: FloatArray
    chosen: bool


@dataclass(frozen=True, eq=False)
class Arrow:
    """A direction that the cloud determines weakly.

    Attributes:
        start: (3,) [m].
        end: (3,) [m]; a translation is along the arrow, a rotation about it.
        turns: whether it is a rotation.
        text: label.
    """

    start: FloatArray
    end: FloatArray
    turns: bool
    text: str


@dataclass(frozen=True, eq=False)
class PairPicture:
    """All arrays of the picture, in the phantom frame [m].

    Attributes:
        cloud: (n, 3).
        vertices: of the phantom.
        faces: of the phantom.
        edges: ends (e, 2, 3) of its sharp edges.
        landmarks: (k, 3).
        names: of the landmarks.
        marks: ends of the existing pairs.
        arrows: weak directions.
        over: whether the cloud lies on the phantom, or beside it.
        lines: start, end and number of each complete pair.
    """

    cloud: FloatArray
    vertices: FloatArray
    faces: IndexArray
    edges: FloatArray
    landmarks: FloatArray
    names: tuple[str, ...]
    marks: tuple[Mark, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    over: bool = False
    lines: tuple[tuple[FloatArray, FloatArray, int], ...] = field(default=())

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Corners (3,), (3,) [m] of the box around the phantom and most of the cloud."""
        low, high = middle_of(self.cloud, float(np.ptp(self.vertices, axis=0).max()))
        return np.minimum(low, self.vertices.min(axis=0)), np.maximum(
            high, self.vertices.max(axis=0)
        )


def middle_of(points: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """Corners (3,), (3,) [m] of the box around most points (n, 3) within `reach` [m] of their
    median.
    """
    centre = np.median(points, axis=0)
    near = points[np.linalg.norm(points - centre, axis=1) < reach]
    low, high = np.percentile(near if len(near) else points, [4, 96], axis=0)
    return low, high


def pair_colour(number: int) -> Rgb:
    """Colour of a pair by its number from 0; successive numbers differ strongly."""
    red, green, blue = colorsys.hls_to_rgb((0.58 + number * 0.381966) % 1.0, 0.45, 0.75)
    return int(255 * red), int(255 * green), int(255 * blue)
