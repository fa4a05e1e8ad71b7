"""What the screening asks of an effect whose action near nothing is a straight line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from palpate.diagnosis.criteria import CRITERIA
from palpate.effects import Effect
from palpate.setup.setup import Setup

__all__ = ["Tangent", "changed_at_rest"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Tangent:
    """One column: how the data change with one number of an effect, or to first order with all that
    the effect does.

    Attributes:
        effect: where nothing is wrong yet, or of the size whose action is meant.
        of: the number whose search coordinate the column changes by one; empty for the effect's
            whole action.
        spread: prior standard deviation of the column's factor.
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
        step = CRITERIA.derivatives.step * self.effect.numbers()[place].scale
        coordinates[place] += step
        return self.effect.at(coordinates).apply(setup), step


def changed_at_rest(
    tangents: Sequence[Tangent], places: Sequence[int], setup: Setup
) -> dict[int, tuple[Setup, float]]:
    """Columns of the tangents that show while nothing is pushed: to the setup a little changed, and
    the step.
    """
    own = zip(places, tangents, strict=True)
    return {place: tangent.changed(setup) for place, tangent in own if tangent.effect.at_rest()}
