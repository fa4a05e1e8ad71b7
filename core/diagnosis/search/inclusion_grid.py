"""Places for a lump beneath pushes: where forces alone can tell of one."""

from __future__ import annotations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Inclusion, Shape

__all__ = ["lumps_under"]


def lumps_under(
    places: FloatArray, normals: FloatArray, body: Box | Shape
) -> tuple[Inclusion, ...]:
    """Lumps under places (k, 3) [m] of the surface with outward normals (k, 3), whose centres lie
    within the body.
    """
    kept: list[int] = []
    for number, place in enumerate(places):
        if all(
            np.linalg.norm(place - places[other]) >= CRITERIA.inclusion_grid.spacing
            for other in kept
        ):
            kept.append(number)
    found = []
    for number in kept:
        for depth in CRITERIA.inclusion_grid.depths:
            x, y, z = (float(value) for value in places[number] - depth * normals[number])
            if z > 0 and body.facing(np.array([[x, y, z]]))[0][0] < 0:
                found.append(
                    Inclusion(
                        x=x,
                        y=y,
                        z=z,
                        radius=CRITERIA.inclusion_grid.radius,
                        stiffness_ratio=CRITERIA.inclusion_grid.stiffness_ratio,
                    )
                )
    return tuple(found)
