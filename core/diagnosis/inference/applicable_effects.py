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
        setup: as stated; some effects need a box, some a free form.
        clouds: whether any sequence has clouds.
        forces: whether any has forces.
        catalogue: to choose from.
    """
    made = {Measurement.CLOUDS: clouds, Measurement.FORCES: forces}
    box = setup.geometry.is_block
    return tuple(
        kind
        for kind in catalogue
        if any(made[item] for item in kind.shown_by)
        and (box or not kind.needs_box)
        and not (box and kind.needs_shape)
    )
