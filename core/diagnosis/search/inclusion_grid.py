"""Places for a lump beneath pushes: where forces alone can tell of one."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Inclusion, Shape

__all__ = ["DEPTHS", "lumps_under"]

RADIUS, RATIO = 7e-3, 5.0
DEPTHS = (9e-3, 14e-3)
"""Of a lump's centre below the surface [m] that are tried; a push of some millimetres hardly feels
what lies deeper."""
_APART = 7e-3
"""Pushes nearer to one another than this [m] share their places."""


def lumps_under(
    places: FloatArray, normals: FloatArray, body: Box | Shape
) -> tuple[Inclusion, ...]:
    """Lumps under places (k, 3) [m] of the surface with outward normals (k, 3), whose centres lie
    within the body.
    """
    kept: list[int] = []
    for number, place in enumerate(places):
        if all(np.linalg.norm(place - places[other]) >= _APART for other in kept):
            kept.append(number)
    found = []
    for number in kept:
        for depth in DEPTHS:
            x, y, z = (float(value) for value in places[number] - depth * normals[number])
            if z > 0 and body.facing(np.array([[x, y, z]]))[0][0] < 0:
                found.append(Inclusion(x=x, y=y, z=z, radius=RADIUS, stiffness_ratio=RATIO))
    return tuple(found)
