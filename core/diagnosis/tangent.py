"""What the screening asks of an effect whose action near nothing is a straight line."""

from __future__ import annotations

from dataclasses import dataclass

from core.effects import Effect
from core.setup import Setup

__all__ = ["SMALL", "Tangent"]

SMALL = 1e-3
"""Step of a derivative, in the scale of what is moved."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """One column: how the data change with one number of an effect, or to first order with all that the effect does.

    Attributes:
        effect: where nothing is wrong yet, or of the size whose action is meant. of: the number whose search coordinate the column
            changes by one; empty for the effect's whole action. spread: prior standard deviation of the column's factor.
    """

    effect: Effect
    of: str = ""
    spread: float

    def changed(self, setup: Setup) -> tuple[Setup, float]:
        """The setup with the change in it, and how many of the column's units that is."""
        if not self.of:
            return self.effect.apply(setup), 1.0
        coordinates, names = self.effect.coordinates, [item.name for item in self.effect.numbers()]
        place = names.index(self.of)
        step = SMALL * self.effect.numbers()[place].scale
        coordinates[place] += step
        return self.effect.at(coordinates).apply(setup), step
