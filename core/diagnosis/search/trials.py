"""Screenings and trials: the linear gains of the catalogue, and fits of single sets of causes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.evidence import predictive_gain
from palpate.diagnosis.inference.gauss_newton import refit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.search.candidates import candidates_of, tangents_of
from palpate.diagnosis.search.findings import Trial
from palpate.diagnosis.search.inclusion_grid import inclusion_places
from palpate.diagnosis.search.screening import Candidate, linear_gains, right_sides
from palpate.diagnosis.search.signatures import Signature, updated_signatures
from palpate.effects import Effect

__all__ = ["Screening", "gain_over", "screen", "screen_again", "trial_of"]

Screening = tuple[Model, list[Candidate], np.ndarray]
"""A model with the catalogue as columns, the candidates, and the linear gain of each [nats]."""


def screen(
    evaluator: Evaluator, model: Model, signatures: Sequence[Signature], origin: Model
) -> Screening:
    """Screen the catalogue on top of a model.

    Args:
        evaluator: of the inference problem.
        model: with columns of tangents and inclusions.
        signatures: of the effects that are screened at a finite size.
        origin: the model from which their changes are counted.
    """
    extended = evaluator.with_signatures(model, signatures, origin)
    candidates = candidates_of(extended, evaluator, signatures)
    blocks = evaluator.tempered(extended)
    nuisance = (*extended.nuisance, *extended.columns)
    known = evaluator.bounded_precision(extended)
    gains = linear_gains(blocks, right_sides(blocks), nuisance, known, candidates)[0]
    return extended, candidates, gains


def screen_again(
    evaluator: Evaluator, model: Model, signatures: Sequence[Signature], origin: Model
) -> Screening:
    """Screen the catalogue on top of a model that has causes; arguments as for `screen`."""
    problem = evaluator.problem
    tangents = tangents_of(problem.applicable, model.setup, model.names)
    places = inclusion_places(problem)
    extended = evaluator.evaluate(model.effects, model.predictions, tangents, places)
    updated = updated_signatures(evaluator, extended, signatures, origin)
    return screen(evaluator, extended, updated, origin)


def trial_of(
    evaluator: Evaluator,
    effects: Sequence[Effect],
    starts: Sequence[Prediction],
    against: Model,
    hopeless: float = -np.inf,
) -> Trial:
    """Fit these effects and return the model with its gain.

    Args:
        evaluator: of the inference problem.
        effects: as the fit starts.
        starts: predictions to begin from, one for each sequence.
        against: the model that the gain is over.
        hopeless: a model whose log evidence will hardly reach this [nats] is given up.
    """
    model = refit(evaluator, effects, starts, hopeless)
    return Trial(model, gain_over(evaluator, model, against), evaluator.misfit(model))


def gain_over(evaluator: Evaluator, model: Model, other: Model) -> float:
    """Return the gain of a model over another one [nats]."""
    return predictive_gain(evaluator.score(model), evaluator.score(other))[0]
