"""Setups that differ a little in one number of an effect, from which columns are derived."""

from __future__ import annotations

from collections.abc import Sequence

from palpate.diagnosis.criteria import CRITERIA
from palpate.effects import Effect, Tangent
from palpate.effects.base import with_effects
from palpate.setup.setup import Setup

__all__ = ["SetupChange", "changes_at_rest", "prior_deviation", "stepped_setup", "tangent_setup"]

SetupChange = tuple[Setup, float]
"""A setup that differs a little, and the size of the difference in the column's units."""


def tangent_setup(tangent: Tangent, setup: Setup) -> SetupChange:
    """Return the setup with a tangent's change in it, and the size of the change."""
    effect = tangent.effect
    if not tangent.of:
        return effect.apply(setup), 1.0
    coordinates, names = effect.coordinates, [item.name for item in effect.numbers()]
    place = names.index(tangent.of)
    step = CRITERIA.derivatives.step * effect.numbers()[place].scale
    coordinates[place] += step
    return effect.at(coordinates).apply(setup), step


def prior_deviation(tangent: Tangent) -> float:
    """Return the prior standard deviation of a tangent's factor."""
    if tangent.deviation is not None:
        return tangent.deviation
    scale = next(item.scale for item in tangent.effect.numbers() if item.name == tangent.of)
    return CRITERIA.priors.parameter_steps * scale


def stepped_setup(
    stated: Setup, effects: Sequence[Effect], index: int, number: int, step: float
) -> SetupChange:
    """Return the setup with one number of one of its effects a step further, and the step.

    Args:
        stated: without the effects.
        effects: all of the setup's effects.
        index: of the effect.
        number: of its number.
        step: in the number's scale; it is taken backwards where the upper bound is too close.
    """
    effect, item = effects[index], effects[index].numbers()[number]
    coordinates, size = effect.coordinates, step * item.scale
    if item.coordinate(item.high) - coordinates[number] < size:
        size = -size
    coordinates[number] += size
    changed = [*effects[:index], effect.at(coordinates), *effects[index + 1 :]]
    return with_effects(stated, changed), size


def changes_at_rest(
    tangents: Sequence[Tangent], columns: Sequence[int], setup: Setup
) -> dict[int, SetupChange]:
    """Return the changed setup by column for the tangents that the block at rest shows."""
    own = zip(columns, tangents, strict=True)
    return {
        column: tangent_setup(tangent, setup) for column, tangent in own if tangent.effect.at_rest()
    }
