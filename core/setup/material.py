"""The material of a body, as assumed."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from palpate.foundation.errors import SetupError
from palpate.setup.bounds import POISSON_RATIOS, require_within

__all__ = [
    "AnyInclusion",
    "Fibres",
    "Inclusion",
    "Layer",
    "Material",
    "MaterialLaw",
    "Point",
    "Relaxation",
    "Tube",
]

MaterialLaw = Literal["neo_hooke", "corotational"]
Point = tuple[float, float, float]
"""A place (x, y, z) in the phantom frame [m]."""


@dataclass(frozen=True, kw_only=True)
class Inclusion:
    """A ball of other stiffness.

    Attributes:
        x: of the centre, phantom frame [m].
        y: likewise [m].
        z: likewise [m].
        radius: [m].
        stiffness_ratio: stiffness of the inclusion over that of the rest [1].
    """

    listed: ClassVar[str] = "inclusions"
    x: float
    y: float
    z: float
    radius: float
    stiffness_ratio: float

    @property
    def polyline(self) -> tuple[Point, ...]:
        """The centre, as the line of one point around which the ball lies."""
        return ((self.x, self.y, self.z),)


@dataclass(frozen=True, kw_only=True)
class Tube:
    """A tube of other stiffness, such as an artery or a wire: all within a distance of a line.

    Attributes:
        polyline: points (x, y, z) of the axis in their order, phantom frame [m]; at least two.
        radius: [m].
        stiffness_ratio: stiffness of the tube over that of the rest [1].
    """

    listed: ClassVar[str] = "tubes"
    polyline: tuple[Point, ...]
    radius: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        if len(self.polyline) < 2:
            raise SetupError(
                f"the polyline of a tube has {len(self.polyline)} points; state at least two",
                key="polyline",
            )
        require_within("tube radius", self.radius, 1e-5, 2.0, "m")
        require_within("tube stiffness_ratio", self.stiffness_ratio, 1e-3, 1e3, "")


AnyInclusion = Inclusion | Tube
"""A part of other stiffness: all within `radius` of its `polyline`. `listed` is its key in
`Setup.as_dict`."""


def _listed(inclusions: Iterable[AnyInclusion]) -> dict[str, list[dict[str, Any]]]:
    """Plain values of inclusions by kind; kinds other than balls are left out without any."""
    found: dict[str, list[dict[str, Any]]] = {Inclusion.listed: []}
    for one in inclusions:
        found.setdefault(one.listed, []).append(vars(one))
    return found


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A skin of other stiffness on the top.

    Attributes:
        thickness: [m].
        stiffness_ratio: stiffness of the skin over that of the rest [1].
    """

    thickness: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        require_within("layer thickness", self.thickness, 1e-5, 2.0, "m")
        require_within("layer stiffness_ratio", self.stiffness_ratio, 1e-3, 1e3, "")


@dataclass(frozen=True, kw_only=True)
class Fibres:
    """Fibres along one direction in the horizontal plane.

    Attributes:
        direction: angle from the x axis [rad].
        stiffness_ratio: Young's modulus along the fibres over that across [1].
    """

    direction: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        require_within("fibres stiffness_ratio", self.stiffness_ratio, 1.0, 1e3, "")


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """One term of a Prony series.

    Attributes:
        fraction: share of the shear modulus that relaxes [1].
        time_constant: [s].
    """

    fraction: float
    time_constant: float

    def __post_init__(self) -> None:
        require_within("relaxation fraction", self.fraction, 0.0, 1.0, "")
        require_within("relaxation time_constant", self.time_constant, 1e-6, 1e9, "s")


@dataclass(frozen=True, kw_only=True)
class Material:
    """The material of a body.

    Attributes:
        young_modulus: Young's modulus at small strain [Pa]; of a viscoelastic material the
            instantaneous one.
        poisson_ratio: Poisson's ratio, likewise [1].
        law: of elasticity.
        inclusions: balls and tubes of other stiffness inside.
        layer: a skin on the top; None for none.
        log_ratio: ln of Young's modulus at the top over that at the base, with the geometric mean
            kept [1].
        stretch_limit: J_m of Gent's law [1], at which the material cannot be stretched further;
            None for neo-Hooke.
        fibres: along one direction; None for an isotropic material.
        relaxation: terms of a Prony series, whose fractions add up to less than one
            (`palpate.replay.material_history`).
        retained_fraction: share of the largest strain that stays when the load is gone [1]
            (`palpate.replay.material_history`).
    """

    young_modulus: float = 5.0e3
    poisson_ratio: float = 0.45
    law: MaterialLaw = "neo_hooke"
    inclusions: tuple[AnyInclusion, ...] = ()
    layer: Layer | None = None
    log_ratio: float = 0.0
    stretch_limit: float | None = None
    fibres: Fibres | None = None
    relaxation: tuple[Relaxation, ...] = ()
    retained_fraction: float = 0.0

    def __post_init__(self) -> None:
        require_within("young_modulus", self.young_modulus, 1.0, 1e9, "Pa")
        require_within("poisson_ratio", self.poisson_ratio, *POISSON_RATIOS, "")
        require_within("log_ratio", self.log_ratio, -7.0, 7.0, "")
        if self.stretch_limit is not None:
            require_within("stretch_limit", self.stretch_limit, 0.1, 1e6, "")
            if self.law == "corotational":
                raise SetupError(
                    "the corotational law has no stretch_limit; use neo_hooke with it",
                    key="stretch_limit",
                )
        require_within(
            "relaxed fractions in all",
            sum(term.fraction for term in self.relaxation),
            0.0,
            0.99,
            "",
        )
        require_within("retained_fraction", self.retained_fraction, 0.0, 0.9, "")
        if self.has_history and self.law == "corotational":
            key = "relaxation" if self.relaxation else "retained_fraction"
            raise SetupError(f"the corotational law has no {key}; use neo_hooke with it", key=key)

    @property
    def has_history(self) -> bool:
        """Whether its stress depends on earlier deformation."""
        return bool(self.relaxation or self.retained_fraction)

    @property
    def listed_inclusions(self) -> dict[str, list[dict[str, Any]]]:
        """Plain values of the inclusions by kind, as `Setup.as_dict` lists them."""
        return _listed(self.inclusions)
