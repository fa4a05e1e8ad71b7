"""What a block is made of, as believed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from palpate.foundation.errors import SetupError
from palpate.setup.bounds import within as _within

__all__ = ["Fibres", "Inclusion", "Layer", "Material", "MaterialLaw", "Relaxation"]

MaterialLaw = Literal["neo_hooke", "corotational"]


@dataclass(frozen=True, kw_only=True)
class Inclusion:
    """A ball of other stiffness: centre in the phantom frame [m], radius [m], stiffness of lump
    over rest [1].
    """

    x: float
    y: float
    z: float
    radius: float
    stiffness_ratio: float


@dataclass(frozen=True, kw_only=True)
class Layer:
    """A skin of other stiffness on the top: thickness [m], stiffness of skin over rest [1]."""

    thickness: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        _within("layer thickness", self.thickness, 1e-5, 2.0, "m")
        _within("layer stiffness_ratio", self.stiffness_ratio, 1e-3, 1e3, "")


@dataclass(frozen=True, kw_only=True)
class Fibres:
    """Stiffer along one direction in the plane: its angle from the x axis [rad], E along over E
    across [1].
    """

    direction: float
    stiffness_ratio: float

    def __post_init__(self) -> None:
        _within("fibres stiffness_ratio", self.stiffness_ratio, 1.0, 1e3, "")


@dataclass(frozen=True, kw_only=True)
class Relaxation:
    """One term of a Prony series: the share of the shear modulus that relaxes [1], and its time
    constant [s].
    """

    fraction: float
    time_constant: float

    def __post_init__(self) -> None:
        _within("relaxation fraction", self.fraction, 0.0, 1.0, "")
        _within("relaxation time_constant", self.time_constant, 1e-6, 1e9, "s")


@dataclass(frozen=True, kw_only=True)
class Material:
    """What the block is made of.

    Attributes:
        young_modulus: at rest [Pa]; of a material that relaxes, that of a motion faster than it
            does.
        poisson_ratio: likewise [1].
        law: of elasticity.
        inclusions: lumps inside.
        layer: a skin on the top.
        log_ratio: ln of Young's modulus at the top over that at the base, its geometric mean kept
            [1].
        stretch_limit: J_m of Gent's law [1], where the material is stretched to its limit; None for
            a material without.
        fibres: along one direction; None for a material that is the same in all.
        relaxation: terms of a Prony series, whose fractions add up to less than one.
        retained_fraction: of the largest strain that stays when the load is gone [1]. Both as
            `palpate.replay.material_history` has them.
    """

    young_modulus: float = 5.0e3
    poisson_ratio: float = 0.45
    law: MaterialLaw = "neo_hooke"
    inclusions: tuple[Inclusion, ...] = ()
    layer: Layer | None = None
    log_ratio: float = 0.0
    stretch_limit: float | None = None
    fibres: Fibres | None = None
    relaxation: tuple[Relaxation, ...] = ()
    retained_fraction: float = 0.0

    def __post_init__(self) -> None:
        _within("young_modulus", self.young_modulus, 1.0, 1e9, "Pa")
        _within("poisson_ratio", self.poisson_ratio, -0.5, 0.4999, "")
        _within("log_ratio", self.log_ratio, -7.0, 7.0, "")
        if self.stretch_limit is not None:
            _within("stretch_limit", self.stretch_limit, 0.1, 1e6, "")
            if self.law == "corotational":
                raise SetupError(
                    "the corotational law has no stretch_limit; use neo_hooke with it",
                    key="stretch_limit",
                )
        _within(
            "relaxed fractions in all",
            sum(term.fraction for term in self.relaxation),
            0.0,
            0.99,
            "",
        )
        _within("retained_fraction", self.retained_fraction, 0.0, 0.9, "")
        if self.has_history and self.law == "corotational":
            key = "relaxation" if self.relaxation else "retained_fraction"
            raise SetupError(f"the corotational law has no {key}; use neo_hooke with it", key=key)

    @property
    def has_history(self) -> bool:
        """Whether its stress depends on what was done to it before."""
        return bool(self.relaxation or self.retained_fraction)
