"""Length of a mesh's edges from place to place."""

from __future__ import annotations

from dataclasses import dataclass

from palpate.foundation.arrays import FloatArray

__all__ = ["SizeField"]


@dataclass(frozen=True, eq=False, kw_only=True)
class SizeField:
    """Edges that are short around some points and grow with the distance from them.

    Attributes:
        places: (k, 3) the points [m].
        radius: distance from a point within which edges are shortest [m].
        finest: length there [m].
        coarsest: largest length [m].
        growth: increase of the length per distance [1].
    """

    places: FloatArray
    radius: float
    finest: float
    coarsest: float
    growth: float
