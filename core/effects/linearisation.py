"""Properties of an effect that a diagnosis reads: its linearisation, data, and nuisances.

Each is declared by the effect's class. A diagnosis knows these kinds and no class of effects.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    from palpate.effects.base import Effect

__all__ = ["Linearisation", "Measurement", "NuisanceBlock", "Tangent"]


class Linearisation(Enum):
    """The way in which the screening turns an effect into columns of a linear problem."""

    TANGENT = "tangent"
    """Derivatives by the effect's numbers, from the tangent stiffness of one replay."""
    LOCAL_STIFFNESS = "local stiffness"
    """Derivatives by the stiffness of balls on a grid of places in the body."""
    FINITE_DIFFERENCE = "finite difference"
    """Difference of two replays, with the effect at a finite size and without it."""
    HISTORY = "history"
    """First-order change of a material or contact with history, from a replay without it."""
    NUISANCE = "nuisance"
    """Columns of a nuisance parameter that every model has, with a wider prior."""


class NuisanceBlock(Enum):
    """The nuisance parameters of every model, in the order of their columns.

    The value is the name; `size` is the number of parameters.
    """

    TOOL_POSITION = "tool position", 3
    TOOL_ROTATION = "tool rotation", 3
    TOOL_RADIUS = "tool radius", 1
    POISSON_RATIO = "Poisson's ratio", 1
    CAMERA_POSE = "camera pose", 6
    YOUNG_MODULUS = "Young's modulus", 1
    MESH_ERROR = "mesh error", 1

    size: int

    def __new__(cls, label: str, size: int) -> Self:
        """Make a member from its name and its number of parameters."""
        member = object.__new__(cls)
        member._value_, member.size = label, size
        return member


class Measurement(Enum):
    """A kind of measurement that can show an effect."""

    CLOUDS = "clouds"
    FORCES = "forces"


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """One column of an effect that is linearised by derivatives.

    Attributes:
        effect: where nothing is wrong yet, or at the size whose whole change is the column.
        of: the number whose search coordinate the column changes by one; empty for the effect's
            whole change.
        deviation: prior standard deviation of the column's factor; None for the usual number of
            the parameter's scales.
    """

    effect: Effect
    of: str = ""
    deviation: float | None = None
