"""Places of inclusions that are tried: a grid in a block, or below what the tool touches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.inference_problem import InferenceProblem
from palpate.effects import Effect, Linearisation
from palpate.effects.elastic_material import inclusion_grid
from palpate.foundation.arrays import FloatArray
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import AnyInclusion, Inclusion

__all__ = ["ScreenedInclusions", "inclusion_places", "inclusions_under", "screened_inclusions"]


@dataclass(frozen=True, eq=False)
class ScreenedInclusions:
    """The inclusions that are screened.

    Attributes:
        lumps: those of `inclusion_places`, in which the engine's stiffness may be off as well, and
            then further ones.
        spots: number of the former.
        effects: each neutral effect with the number of its inclusion.
    """

    lumps: tuple[AnyInclusion, ...]
    spots: int
    effects: tuple[tuple[Effect, int], ...]


def screened_inclusions(problem: InferenceProblem) -> ScreenedInclusions:
    """Return the inclusions of all effects that are linearised by local stiffness."""
    places = inclusion_places(problem)
    numbers: dict[AnyInclusion, int] = {}
    for place in places:
        numbers.setdefault(place, len(numbers))
    spots = len(numbers)
    effects = [
        (effect, numbers.setdefault(lump, len(numbers)))
        for kind in problem.applicable
        if kind.linearisation is Linearisation.LOCAL_STIFFNESS
        for effect, lump in kind.screened(places, problem.setup)
    ]
    return ScreenedInclusions(tuple(numbers), spots, tuple(effects))


def inclusion_places(problem: InferenceProblem) -> tuple[Inclusion, ...]:
    """Return the inclusions that are tried.

    They are a coarse grid in a block under a camera. A free form may be large and thin; there, as
    without clouds, they lie below the places that the tool touches.
    """
    geometry = problem.setup.geometry
    if not problem.clouds:
        return inclusions_under(*problem.pushes, geometry)
    if geometry.is_block:
        return inclusion_grid(problem.setup)
    return inclusions_under(*problem.contacts, geometry)


def inclusions_under(
    places: FloatArray, normals: FloatArray, body: Geometry
) -> tuple[Inclusion, ...]:
    """Return inclusions below places of the surface whose centres are in the body.

    Args:
        places: (k, 3) [m].
        normals: outwards there (k, 3).
        body: in whose frame they are.
    """
    used: list[int] = []
    for number, place in enumerate(places):
        if all(
            np.linalg.norm(place - places[other]) >= CRITERIA.inclusion_grid.spacing
            for other in used
        ):
            used.append(number)
    found = []
    for number in used:
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
