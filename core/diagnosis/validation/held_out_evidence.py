"""Gain in log density that found causes have on held-out sequences, with all numbers as fitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import Block, log_evidence
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.posterior import Posterior
from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.diagnosis.validation.held_out_check import held_out_evaluator

__all__ = ["gain_on_held_out"]


def gain_on_held_out(
    evaluator: Evaluator, stated: Model, found: Model, held_out: Sequence[Observations]
) -> float | None:
    """Return the gain of a found model over the stated one on held-out sequences [nats].

    It is the difference of the log densities of these sequences given the fitted ones. Nuisances
    and the causes' numbers are as the fitted sequences determine them.

    Args:
        evaluator: of the fitted sequences.
        stated: model on them.
        found: model on them.
        held_out: the sequences, which the workers must have; None is returned without clouds.
    """
    other = held_out_evaluator(evaluator, held_out)
    if other is None:
        return None
    before = other.baseline((), inclusion_places(other.problem), stated.effects)
    other.state.temperature = evaluator.state.temperature
    after = other.evaluate(found.effects, before.predictions)
    return _predicted(evaluator, found, other, after) - _predicted(evaluator, stated, other, before)


def _predicted(fitted: Posterior, model: Model, other: Posterior, held_out: Model) -> float:
    """Return the log density of held-out sequences given the fitted ones [nats].

    Args:
        fitted: scores the fitted sequences.
        model: on them.
        other: scores the held-out sequences.
        held_out: the same model on them.
    """
    known = [_with_columns(block, model) for block in fitted.tempered(model)]
    new = [
        _with_columns(block, held_out) for block in other.tempered(held_out) if block.name != "rest"
    ]
    columns = range(len(model.nuisance) + len(model.columns))
    precision = fitted.bounded_precision(model)
    return log_evidence([*known, *new], columns, precision) - log_evidence(
        known, columns, precision
    )


def _with_columns(block: Block, model: Model) -> Block:
    """Return the block with the columns of nuisances and causes alone, in this order."""
    kept = np.array([0, *(1 + column for column in (*model.nuisance, *model.columns))])
    return Block(block.name, block.gram[np.ix_(kept, kept)], block.values)
