"""Causes in the phantom's size, in its cast and in its mesh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from palpate.effects.base import Effect, Slot
from palpate.effects.linearisation import Linearisation, NuisanceBlock
from palpate.effects.parameter import parameter
from palpate.foundation.quantities import quantity
from palpate.setup.free_form.cast_modes import cast_modes
from palpate.setup.setup import Setup

__all__ = ["DIAGNOSIS_GRID", "GeometryLocal", "GeometryScale", "MeshResolution"]

_FINEST = 2e-3
"""Edge of elements [m] up to which no grid counts as coarse."""

_STARTED = 3e-4
"""Coefficient of the one mode with which a search may begin [m]."""


def _mode() -> Any:
    """A coefficient. Four scales are its prior deviation, so that an offset of 0.4 mm RMS is
    plausible."""
    return parameter("m", low=-3e-3, high=3e-3, scale=1e-4)


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
class GeometryLocal(Effect):
    """The free surface of the cast is offset along its normals, smoothly: alike over some 2 cm.

    The numbers are coefficients of the modes of `palpate.setup.free_form.cast_modes`, all of which
    are one candidate. The prior holds them near zero, and with them the offset where nothing shows
    it. A report states the offset's RMS and the offset at places of the surface.

    The camera's own smooth error looks alike in the rest cloud; only the tool, which meets the
    surface earlier or later, tells the two apart, and only near the places that it touches.
    """

    name, enters = "geometry_local", Slot.GEOMETRY
    summary = "the cast differs from its drawing in places"
    linearisation, joint, needs_shape = Linearisation.TANGENT, True, True
    by_hand = False
    mode_01: float = _mode()
    mode_02: float = _mode()
    mode_03: float = _mode()
    mode_04: float = _mode()
    mode_05: float = _mode()
    mode_06: float = _mode()
    mode_07: float = _mode()
    mode_08: float = _mode()
    mode_09: float = _mode()
    mode_10: float = _mode()
    mode_11: float = _mode()
    mode_12: float = _mode()
    mode_13: float = _mode()
    mode_14: float = _mode()
    mode_15: float = _mode()
    mode_16: float = _mode()
    mode_17: float = _mode()
    mode_18: float = _mode()
    mode_19: float = _mode()
    mode_20: float = _mode()
    mode_21: float = _mode()
    mode_22: float = _mode()
    mode_23: float = _mode()
    mode_24: float = _mode()

    @classmethod
    def of(cls, coefficients: Sequence[float]) -> Self:
        """Return the effect with these coefficients [m]; those that are missing are zero."""
        names = [item.name for item in cls.numbers()]
        return cls(**{**dict.fromkeys(names, 0.0), **dict(zip(names, coefficients, strict=False))})

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls.of(setup.cast)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls.of([_STARTED])]

    @property
    def coefficients(self) -> tuple[float, ...]:
        """Factor of each mode [m]; empty without an offset."""
        found = tuple(self.coordinates)
        return found if any(found) else ()

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, cast=self.coefficients)

    def reported(self, setup: Setup) -> dict[str, tuple[float | str, str]]:
        """Return the offset's RMS over the free surface away from what is held; the coefficients
        are no quantities of their own.
        """
        return {"rms": (cast_modes(setup.stated_shape).rms(tuple(self.coordinates)), "m")}

    def located(self, setup: Setup) -> dict[str, Any]:
        """Return `field`: the offset [m] at places (k, 3) [m] of the stated surface."""
        shape = setup.stated_shape
        places = shape.surface().patch_centres
        offset = cast_modes(shape).offset(tuple(self.coordinates), places)
        rounded = np.round(places, 5).tolist()
        return {"field": {"places": rounded, "offset": np.round(offset, 6).tolist()}}

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        size_of = quantity(values["rms"], "m")
        return f"that the cast differs from its drawing in places, by {size_of} RMS"


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
