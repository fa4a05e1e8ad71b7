"""The effects that a dataset can show."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.effects import CATALOGUE, Effect, Measurement
from palpate.setup.setup import Setup

__all__ = ["applicable_effects"]


def applicable_effects(
    setup: Setup, *, clouds: bool, forces: bool, catalogue: Sequence[type[Effect]] = CATALOGUE
) -> tuple[type[Effect], ...]:
    """Return the effects that these measurements can show, in the catalogue's order.

    Args:
        setup: as stated; not every setup can have every effect.
        clouds: whether any sequence has clouds.
        forces: whether any has forces.
        catalogue: to choose from.
    """
    made = {Measurement.CLOUDS: clouds, Measurement.FORCES: forces}
    return tuple(
        kind
        for kind in catalogue
        if any(made[item] for item in kind.shown_by) and not kind.impossible(setup)
    )
