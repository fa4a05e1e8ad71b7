"""Causes in the build of the material: skins, gradients, fibres, tubes, and strain stiffening."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Self

import numpy as np

from palpate.effects.base import Effect, Slot
from palpate.effects.elastic_material import inclusion_grid
from palpate.effects.family import STIFFNESS
from palpate.effects.linearisation import Linearisation, Measurement, Tangent
from palpate.effects.parameter import parameter
from palpate.foundation.arrays import FloatArray
from palpate.foundation.quantities import quantity
from palpate.setup.phantom_geometry import Geometry
from palpate.setup.setup import Fibres, Inclusion, Layer, Setup, Tube

__all__ = ["Anisotropy", "StiffTube", "StiffnessGradient", "StrainStiffening", "SurfaceLayer"]

_UNLIMITED = 1e4
"""J_m from which on a material counts as having no limit of stretch [1]."""
_SCREENED_LIMIT = 6.0
"""J_m [1] whose whole first-order change is the column of strain stiffening. Measured: it has a
correlation of 0.99 with replays of J_m 1 and 3."""
_HEADINGS = (0.0, math.pi / 4, math.pi / 2, -math.pi / 4)
"""Directions in which tubes are screened [rad]."""
_TUBES_APART = 12e-3
"""Distance of tubes of one direction that are screened [m], at least."""
_SCREENED_RADIUS = 4e-3
"""Radius of the tubes that are screened [m]."""
_TURNS, _SLIMMER = 8, 0.5
"""Directions of the tubes that are tried through a ball that was fitted, and their radius over its
own [1]: as long as pushes reach, they are about as strong."""
_BEYOND = 1e-2
"""Length by which a tube's axis goes on outside the body [m]."""
_PIECES, _REPORTED = 16, 17
"""Straight pieces of a bent axis, and points of the axis that a report states."""


@dataclass(frozen=True, kw_only=True)
class SurfaceLayer(Effect):
    """A skin of other stiffness, such as a coating or a capsule.

    It lies on the top of a block, and on the free surface of any other body.
    """

    name, enters = "surface_layer", Slot.MATERIAL
    family = STIFFNESS
    summary = "a skin of other stiffness lies on the surface"
    linearisation, amplitude = Linearisation.TANGENT, "stiffness_ratio"
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    thickness: float = parameter("m", low=3e-4, high=2e-2, scale=5e-4, accuracy=3e-4)
    stiffness_ratio: float = parameter("1", low=0.02, high=50.0, scale=0.5, log=True, accuracy=0.15)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        layer = setup.material.layer or Layer(thickness=2e-3, stiffness_ratio=1.0)
        return cls(thickness=layer.thickness, stiffness_ratio=layer.stiffness_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(thickness=2e-3, stiffness_ratio=ratio) for ratio in (0.3, 4.0)]

    @classmethod
    def tangents(cls, setup: Setup) -> Sequence[Tangent]:
        """Return the columns of a thin and of a thick skin.

        Measured: a skin of 0.3 or 4 times the stiffness has a correlation of 0.98 with them.
        """
        return [
            Tangent(effect=cls(thickness=thickness, stiffness_ratio=1.0), of=cls.amplitude)
            for thickness in (2e-3, 5e-3)
        ]

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.layer is None:
            return setup
        layer = Layer(thickness=self.thickness, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, layer=layer))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        thickness, ratio = quantity(values["thickness"], "m"), values["stiffness_ratio"]
        return f"a skin {thickness} thick, {ratio:.2g} times as stiff"


@dataclass(frozen=True, kw_only=True)
class StiffnessGradient(Effect):
    """Stiffness that changes through the height at the same geometric mean.

    log_ratio is ln(E top / E base). Measured: the column has a correlation of 0.999 with replays of
    gradients of 0.7 and -1.2.
    """

    name, enters = "stiffness_gradient", Slot.MATERIAL
    family = STIFFNESS
    summary = "the stiffness changes from the base to the top"
    linearisation = Linearisation.TANGENT
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    log_ratio: float = parameter("1", low=-3.0, high=3.0, scale=0.2, accuracy=0.095)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(log_ratio=setup.material.log_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(log_ratio=ratio) for ratio in (-0.7, 0.7)]

    def apply(self, setup: Setup) -> Setup:
        return replace(setup, material=replace(setup.material, log_ratio=self.log_ratio))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        ratio = values["log_ratio"]
        where, other = ("top", "base") if ratio >= 0 else ("base", "top")
        return (
            "that the stiffness changes with the height: "
            f"the {where} is {math.exp(abs(ratio)):.2g} times as stiff as the {other}"
        )


@dataclass(frozen=True, kw_only=True)
class StrainStiffening(Effect):
    """A material that stiffens with strain: Gent's law."""

    name, enters = "strain_stiffening", Slot.MATERIAL
    family = STIFFNESS
    summary = "the material stiffens with strain"
    linearisation = Linearisation.TANGENT
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    J_m: float = parameter("1", low=0.5, high=_UNLIMITED, scale=0.3, log=True, accuracy=0.08)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        limit = setup.material.stretch_limit
        return cls(J_m=_UNLIMITED if limit is None else min(limit, _UNLIMITED))

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [cls(J_m=limit) for limit in (3.0, 12.0)]

    @classmethod
    def tangents(cls, setup: Setup) -> Sequence[Tangent]:
        """Return one column, which is a share of the whole change of a moderate limit."""
        return [Tangent(effect=cls(J_m=_SCREENED_LIMIT), deviation=1.0)]

    def scaled(self, share: float) -> Self:
        """Return the limit at which the material stiffens by this share [1]."""
        return self.moved([self.J_m / share])

    def apply(self, setup: Setup) -> Setup:
        limit = None if self.J_m >= _UNLIMITED else self.J_m
        return replace(setup, material=replace(setup.material, stretch_limit=limit))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        return f"that the material stiffens with strain, Gent's J_m = {values['J_m']:.2g}"


@dataclass(frozen=True, kw_only=True)
class Anisotropy(Effect):
    """Fibres along one direction in the plane.

    Measured: fibres of 3 times the stiffness have a correlation of 0.95 with the columns.
    """

    name, enters = "anisotropy", Slot.MATERIAL
    summary = "the material is stiffer along one direction"
    linearisation, amplitude = Linearisation.TANGENT, "stiffness_ratio"
    amplitude_deviation = 2.0
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    direction: float = parameter("rad", low=0.0, high=math.pi, scale=0.3, periodic=True)
    stiffness_ratio: float = parameter("1", low=1.0, high=30.0, scale=0.3, log=True, accuracy=0.09)

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        fibres = setup.material.fibres or Fibres(direction=0.0, stiffness_ratio=1.0)
        return cls(direction=fibres.direction % math.pi, stiffness_ratio=fibres.stiffness_ratio)

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        return [
            cls(direction=angle, stiffness_ratio=3.0)
            for angle in (0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)
        ]

    def initial_guess(self, changes: Mapping[str, float]) -> Self:
        """Return fibres that are stiffer; softer along one direction is stiffer across it."""
        change = changes[self.amplitude]
        if change >= 0:
            return super().initial_guess(changes)
        across = replace(self, direction=(self.direction + math.pi / 2) % math.pi)
        return super(Anisotropy, across).initial_guess({self.amplitude: -change})

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0 and setup.material.fibres is None:
            return setup
        fibres = Fibres(direction=self.direction, stiffness_ratio=self.stiffness_ratio)
        return replace(setup, material=replace(setup.material, fibres=fibres))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        stiffer = f"{values['stiffness_ratio']:.2g} times as stiff along one direction as across"
        # A direction has no zero: two digits of 106.9 degrees are outside an interval of two.
        angle = math.degrees(values["direction"])
        return f"fibres: the phantom is {stiffer}, {angle:.0f}° from the x axis"


@dataclass(frozen=True, kw_only=True)
class StiffTube(Effect):
    """A tube of other stiffness right through the body, such as an artery, a vessel or a wire.

    A vertical plane through the middle of the body's bounding box, turned by the heading, gives the
    way t along the tube [m], from where the axis is nearest to the middle. There it is `aside` to
    the left and `z` high. At t, it is `bend` t^2 / 2 farther left, and tan(`inclination`) t + `sag`
    t^2 / 2 higher.
    """

    name, enters = "stiff_tube", Slot.MATERIAL
    family = STIFFNESS
    summary = "a tube of other stiffness runs through the body"
    linearisation, amplitude = Linearisation.LOCAL_STIFFNESS, "stiffness_ratio"
    amplitude_deviation = 0.8
    shown_by = frozenset({Measurement.CLOUDS, Measurement.FORCES})
    aside: float = parameter("m", low=-0.5, high=0.5, scale=3e-3, accuracy=1.4e-4)
    z: float = parameter("m", low=-0.1, high=0.5, scale=3e-3, accuracy=5e-4)
    heading: float = parameter("rad", low=-math.pi, high=math.pi, scale=0.15, periodic=True)
    inclination: float = parameter("rad", low=-1.0, high=1.0, scale=0.1)
    bend: float = parameter("1/m", low=-12.0, high=12.0, scale=1.0)
    sag: float = parameter("1/m", low=-12.0, high=12.0, scale=1.0)
    radius: float = parameter("m", low=5e-4, high=2e-2, scale=0.25, log=True)
    stiffness_ratio: float = parameter(
        "1", low=0.02, high=50.0, scale=0.15, contrast=True, accuracy=0.04
    )

    @classmethod
    def neutral(cls, setup: Setup) -> Self:
        return cls(
            aside=0.0,
            z=setup.geometry.size[2] / 2,
            heading=0.0,
            inclination=0.0,
            bend=0.0,
            sag=0.0,
            radius=_SCREENED_RADIUS,
            stiffness_ratio=1.0,
        )

    @classmethod
    def spans(cls, body: Geometry) -> dict[str, tuple[float, float]]:
        """Return the places within the bounding box."""
        aside = math.hypot(*body.size[:2]) / 2
        return {"aside": (-aside, aside), "z": (float(body.low[2]), float(body.high[2]))}

    @classmethod
    def starts(cls, setup: Setup) -> Sequence[Self]:
        """Return level tubes all over the body, five times as stiff as it."""
        tubes = cls.screened(inclusion_grid(setup), setup)
        return [replace(tube, stiffness_ratio=5.0) for tube, _ in tubes]

    @classmethod
    def screened(cls, places: Sequence[Inclusion], setup: Setup) -> Sequence[tuple[Self, Tube]]:
        """Return level tubes through the places in a few directions, apart from each other."""
        found: list[Self] = []
        middle, neutral = _middle(setup), cls.neutral(setup)
        for heading in _HEADINGS:
            left = np.array([-math.sin(heading), math.cos(heading)])
            beside: list[Self] = []
            for place in places:
                aside = float(left @ (np.array([place.x, place.y]) - middle))
                if all(
                    math.hypot(one.aside - aside, one.z - place.z) >= _TUBES_APART for one in beside
                ):
                    beside.append(replace(neutral, aside=aside, z=place.z, heading=heading))
            found += beside
        return [(tube, tube.lump(setup)) for tube in found]

    @classmethod
    def around(cls, found: Inclusion, setup: Setup) -> Sequence[tuple[Self, Tube]]:
        """Return level tubes through the middle of a ball, in all directions."""
        away = np.array([found.x, found.y]) - _middle(setup)
        radius = next(item for item in cls.numbers() if item.name == "radius")
        tubes = [
            replace(
                cls.neutral(setup),
                aside=float(away @ [-math.sin(heading), math.cos(heading)]),
                z=found.z,
                heading=heading,
                radius=radius.bounded(_SLIMMER * found.radius),
            )
            for heading in (np.arange(_TURNS) * math.pi / _TURNS - math.pi / 2).tolist()
        ]
        return [(tube, tube.lump(setup)) for tube in tubes]

    def lump(self, setup: Setup) -> Tube:
        """Return the tube with its axis from side to side of the bounding box, and a little on."""
        x, y, _ = setup.stated_geometry.size
        end = math.hypot(x, y) / 2 + _BEYOND
        straight = self.bend == self.sag == 0.0
        points = self._axis(setup, np.linspace(-end, end, 2 if straight else _PIECES + 1))
        line = tuple((float(x), float(y), float(z)) for x, y, z in points)
        return Tube(polyline=line, radius=self.radius, stiffness_ratio=self.stiffness_ratio)

    def _axis(self, setup: Setup, way: FloatArray) -> FloatArray:
        """Return points (k, 3) of the axis [m] at ways (k,) along the heading [m]."""
        along = np.array([math.cos(self.heading), math.sin(self.heading)])
        left = np.array([-along[1], along[0]])
        aside = self.aside + self.bend * way**2 / 2
        plan = _middle(setup) + np.outer(way, along) + np.outer(aside, left)
        height = self.z + math.tan(self.inclination) * way + self.sag * way**2 / 2
        return np.column_stack([plan, height])

    def located(self, setup: Setup) -> dict[str, Any]:
        """Return `polyline`: points (k, 3) of the axis from surface to surface, phantom frame [m].

        Of an axis that leaves the body and comes back it is the longest stretch inside. An axis
        outside the body has no points.
        """
        x, y, _ = setup.stated_geometry.size
        end = math.hypot(x, y) / 2 + _BEYOND
        ways = np.linspace(-end, end, 40 * _PIECES + 1)
        inside = setup.geometry.outside(self._axis(setup, ways)) < 0
        edges = np.flatnonzero(np.diff(np.concatenate([[0], inside.astype(int), [0]])))
        if not len(edges):
            return {"polyline": []}
        first, last = max(edges.reshape(-1, 2), key=lambda ends: ends[1] - ends[0])
        stretch = np.linspace(ways[first], ways[last - 1], _REPORTED)
        return {"polyline": np.round(self._axis(setup, stretch), 5).tolist()}

    def apply(self, setup: Setup) -> Setup:
        if self.stiffness_ratio == 1.0:
            return setup
        inclusions = (*setup.material.inclusions, self.lump(setup))
        return replace(setup, material=replace(setup.material, inclusions=inclusions))

    @classmethod
    def phrase(cls, values: Mapping[str, Any], size: Sequence[float] | None = None) -> str:
        kind = "stiff" if values["stiffness_ratio"] >= 1.0 else "soft"
        across, depth = quantity(2 * values["radius"], "m"), values.get("depth")
        angle = f"{math.degrees(values['heading']) % 180:.0f}° from the x axis"
        if depth is not None:
            return f"a {kind} tube, {across} across, {angle}, its axis {depth} under the surface"
        place = f", {quantity(size[2] - values['z'], 'm')} under the top" if size else ""
        return f"a {kind} tube, {across} across{place}, {angle}"


def _middle(setup: Setup) -> FloatArray:
    """Middle (x, y) of the stated body's bounding box [m]."""
    body = setup.stated_geometry
    return np.asarray((body.low + body.high)[:2] / 2)
