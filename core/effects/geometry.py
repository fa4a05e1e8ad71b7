"""Causes in the phantom's shape and in its mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from palpate.effects.base import Effect, Slot
from palpate.effects.linearisation import Linearisation, NuisanceBlock
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.setup import Setup

__all__ = ["DIAGNOSIS_GRID", "GeometryScale", "MeshResolution"]

_FINEST = 2e-3
"""Edge of elements [m] up to which no grid counts as coarse."""


@dataclass(frozen=True, kw_only=True)
class GeometryScale(Effect):
    """The phantom's true lengths over the stated ones.

    The registrations assumed the stated size. With the true size the same touches and the same
    rest cloud give other poses of robot and camera (see `palpate.measurement.touch_correction` and
    `palpate.measurement.camera_model`).
    """

    name, enters = "geometry_scale", Slot.GEOMETRY
    summary = "the phantom is not the stated size"
    linearisation, joint = Linearisation.TANGENT, True
    scale_x: float = parameter("1", low=0.7, high=1.4, scale=0.01, accuracy=2e-3)
    scale_y: float = parameter("1", low=0.7, high=1.4, scale=0.01, accuracy=2e-3)
    scale_z: float = parameter("1", low=0.7, high=1.4, scale=0.01, accuracy=4.7e-3)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        x, y, z = setup.factors
        return cls(scale_x=x, scale_y=y, scale_z=z)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        factors = [[1.05 if axis == other else 1.0 for other in range(3)] for axis in range(3)]
        return [cls(scale_x=x, scale_y=y, scale_z=z) for x, y, z in factors]

    def apply(self, setup: Setup) -> Setup:
        if (self.scale_x, self.scale_y, self.scale_z) == (1.0, 1.0, 1.0):
            return replace(setup, geometry=setup.stated_geometry, registered=None)
        stated = setup.stated_geometry
        true = stated.scaled(np.array([self.scale_x, self.scale_y, self.scale_z]))
        return replace(setup, geometry=true, registered=stated)

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        scales = " × ".join(f"{values[f'scale_{axis}']:.3g}" for axis in "xyz")
        return f"another size of the phantom: {scales} of the stated one"


@dataclass(frozen=True, kw_only=True)
class MeshResolution(Effect):
    """The simulation's grid is too coarse: an even grid of trilinear hexahedra of this size.

    It shares the difference between the two grids of a diagnosis, which is a nuisance.
    """

    name, enters = "mesh_resolution", Slot.GEOMETRY
    summary = "the simulation's own grid is too coarse"
    linearisation, nuisance = Linearisation.NUISANCE, NuisanceBlock.MESH_ERROR
    element_size: float = parameter("m", low=_FINEST, high=2e-2, scale=0.3, log=True)

    @classmethod
    def at_rest(cls) -> bool:
        """Return False: a block that nothing pushes has its shape on any grid."""
        return False

    @classmethod
    def has_derivative(cls) -> bool:
        """Return False: a grid changes by whole elements."""
        return False

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(
            element_size=_FINEST
            if setup.element_size is None
            else min(max(setup.element_size, _FINEST), 2e-2)
        )

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(element_size=size) for size in (5e-3, 9e-3)]

    def apply(self, setup: Setup) -> Setup:
        return replace(
            setup, element_size=None if self.element_size <= _FINEST else self.element_size
        )

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        edge = quantity(values["element_size"], "m")
        return f"a finer grid: the stated one is too coarse, {edge} would do"


DIAGNOSIS_GRID = MeshResolution(element_size=_FINEST)
"""The grid of the diagnosis in place of a stated one."""
