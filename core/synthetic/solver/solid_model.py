"""The true material and supports of a virtual block."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.obstacles import Neighbour, Shaft

__all__ = ["SolidModel"]


@dataclass(frozen=True)
class SolidModel:
    """True properties of the block.

    Attributes:
        young_modulus: (e, 4) at the volume points [Pa].
        poisson_ratio: [1], the same everywhere or (e, 4) at the volume points.
        weight: per volume [N/m^3], the same everywhere or (e, 4).
        held: (n,) bool, nodes that do not move.
        tool_radius: [m].
        lifts: whether some of the base may lift off the table.
        stretch_limit: J_m of Gent's law [1]; None without.
        exponential: whether stiffening follows the exponential law of the same beginning instead.
        fibres: (k, 3) unit vectors along families of fibres that share the modulus; None without.
        fibre_modulus: of the fibres over Young's modulus [1].
        springs: (f, q) stiffness per area, in all directions, at the points of the sole [N/m^3];
            None without.
        relaxed: share of the shear modulus that has relaxed after a long rest [1].
        shaft: the part of the tool beside the ball that may touch the block; None without.
        neighbour: a body against a face; None without.
    """

    young_modulus: FloatArray
    poisson_ratio: FloatArray | float
    weight: FloatArray | float
    held: Any
    tool_radius: float
    lifts: bool
    stretch_limit: float | None = None
    exponential: bool = False
    fibres: FloatArray | None = None
    fibre_modulus: float = 0.0
    springs: FloatArray | None = None
    relaxed: float = 0.0
    shaft: Shaft | None = None
    neighbour: Neighbour | None = None
