"""What a person sees while registering by hand: cloud, phantom, landmarks, numbered pairs, weak
directions; as arrays to draw.
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
    """One end of a pair in the scene: which pair (from 0), on which side (cloud or mesh), where
    (3,) [m], whether it is chosen.
    """

    pair: int
    side: str
    place: FloatArray
    chosen: bool


@dataclass(frozen=True, eq=False)
class Arrow:
    """A direction that the cloud determines weakly.

    Attributes:
        start, end: (3,) [m]; a motion goes along it, a turn goes round it.
        turns: whether it is a turn.
        text: what stands beside it.
    """

    start: FloatArray
    end: FloatArray
    turns: bool
    text: str


@dataclass(frozen=True, eq=False)
class PairPicture:
    """All of it, in the frame of the scene [m], which is the phantom's.

    Attributes:
        cloud: (n, 3).
        vertices, faces: of the phantom.
        landmarks: (k, 3), and their names.
        marks: ends of pairs that are there.
        over: whether the cloud lies on the phantom, or beside it.
    """

    cloud: FloatArray
    vertices: FloatArray
    faces: IndexArray
    landmarks: FloatArray
    names: tuple[str, ...]
    marks: tuple[Mark, ...] = ()
    arrows: tuple[Arrow, ...] = ()
    over: bool = False
    lines: tuple[tuple[FloatArray, FloatArray, int], ...] = field(default=())

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Corners (3,), (3,) [m] of the box around the phantom and the middle of the cloud."""
        low, high = middle_of(self.cloud, float(np.ptp(self.vertices, axis=0).max()))
        return np.minimum(low, self.vertices.min(axis=0)), np.maximum(
            high, self.vertices.max(axis=0)
        )


def middle_of(points: FloatArray, reach: float) -> tuple[FloatArray, FloatArray]:
    """Corners (3,), (3,) [m] of the box around nearly all points (n, 3) within `reach` [m] of their
    median.
    """
    centre = np.median(points, axis=0)
    near = points[np.linalg.norm(points - centre, axis=1) < reach]
    low, high = np.percentile(near if len(near) else points, [4, 96], axis=0)
    return low, high


def pair_colour(number: int) -> Rgb:
    """The colour of a pair by its number from 0: neighbours differ most."""
    red, green, blue = colorsys.hls_to_rgb((0.58 + number * 0.381966) % 1.0, 0.45, 0.75)
    return int(255 * red), int(255 * green), int(255 * blue)
