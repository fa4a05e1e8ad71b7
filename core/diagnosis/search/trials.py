"""Screenings and trials: the linear gains of the catalogue, and fits of single sets of causes.

A cause beside one with history is fitted up to three times: with the change by the history held as
it is, which costs plain replays alone; then, if that is promising, with everything; and, if it may
be the best, with columns that are replayed along the tool's path.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evaluate import Evaluator, SharedEvaluator
from palpate.diagnosis.inference.evaluate_history import plain_model
from palpate.diagnosis.inference.evidence import predictive_gain
from palpate.diagnosis.inference.final_fit import settle, with_columns_of
from palpate.diagnosis.inference.gauss_newton import refit, worth_while
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.search.candidates import candidates_of, local_candidate, tangents_of
from palpate.diagnosis.search.findings import Trial
from palpate.diagnosis.search.inclusion_grid import screened_inclusions
from palpate.diagnosis.search.initial_guess import initial_guess
from palpate.diagnosis.search.screening import Candidate, linear_gains, right_sides
from palpate.diagnosis.search.signatures import Signature, updated_signatures
from palpate.effects import Effect, Tangent
from palpate.effects.base import with_effects
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import AnyInclusion

__all__ = [
    "HeldHistory",
    "Screening",
    "gain_over",
    "screen",
    "screen_again",
    "settled_trials",
    "starts_around",
    "trial_of",
]

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
    lumps = screened_inclusions(problem).lumps
    extended = evaluator.evaluate(model.effects, model.predictions, tangents, lumps)
    if model.has_history:  # beside its replayed columns, those of another cause promise less
        extended = with_columns_of(evaluator, extended, model, model.columns, len(lumps))
    updated = updated_signatures(evaluator, extended, signatures, origin)
    return screen(evaluator, extended, updated, origin)


def trial_of(
    evaluator: Evaluator,
    effects: Sequence[Effect],
    starts: Sequence[Prediction],
    against: Model,
    hopeless: float = -np.inf,
    beside: Model | None = None,
) -> Trial:
    """Fit these effects and return the model with its gain.

    Args:
        evaluator: of the inference problem.
        effects: as the fit starts.
        starts: predictions to begin from, one for each sequence.
        against: the model that the gain is over.
        hopeless: a model whose log evidence will hardly reach this [nats] is given up.
        beside: fitted model with history that the last effect, which has none, extends.
    """
    if beside is not None and beside.has_history and not effects[-1].has_history():
        # Its change is off by up to a half, and its gain by a quarter: no reason to give it up
        # that is only behind another one.
        held, least = HeldHistory(evaluator, beside), evaluator.objective(beside)
        model = refit(held, effects, held.plain.predictions, least)
        if evaluator.objective(model) < least:
            return Trial(model, gain_over(evaluator, model, against), evaluator.misfit(model))
        effects = model.effects
    model = refit(evaluator, effects, starts, hopeless)
    return Trial(model, gain_over(evaluator, model, against), evaluator.misfit(model))


def starts_around(evaluator: Evaluator, trials: Sequence[Trial], current: Model) -> list[Effect]:
    """Return the best start of each effect of another shape than the best ball, where that lies.

    Screened on a grid, a thin tube is seldom where the true one is. But a ball that is fitted to a
    tube lies on it, about as deep.

    Args:
        evaluator: of the inference problem.
        trials: of a further cause each.
        current: model that they extend.
    """
    best = max((trial.gain for trial in trials), default=0.0)
    balls = [trial for trial in trials if trial.model.effects[-1].inclusion is not None]
    chosen = max(balls, key=lambda trial: trial.gain, default=None)
    if chosen is None or chosen.gain < CRITERIA.screening.other_shapes * best:
        return []
    problem, ball = evaluator.problem, chosen.model.effects[-1].inclusion
    assert ball is not None
    rows = [
        row
        for kind in problem.applicable
        if kind.name not in current.names
        for row in kind.around(ball, problem.setup)
    ]
    if not rows:
        return []
    lumps = [lump for _, lump in rows]
    if current.has_history:  # held as it is: a replay along the tool's path costs minutes
        held = HeldHistory(evaluator, current)
        model = held.evaluate(current.effects, held.plain.predictions, (), lumps)
    else:
        model = evaluator.evaluate(current.effects, current.predictions, (), lumps)
    pairs = zip(rows, model.layout.inclusions, strict=True)
    candidates = [local_candidate(effect, column) for (effect, _), column in pairs]
    blocks, nuisance = evaluator.tempered(model), (*model.nuisance, *model.columns)
    known = evaluator.bounded_precision(model)
    gains = linear_gains(blocks, right_sides(blocks), nuisance, known, candidates)[0]
    first: dict[str, Effect] = {}
    for number in np.argsort(-gains):
        candidate = candidates[number]
        if candidate.start.name not in first:
            first[candidate.start.name] = initial_guess(candidate, model, evaluator)
    return list(first.values())


def settled_trials(
    evaluator: Evaluator, trials: Sequence[Trial], against: Model, least: Sequence[float]
) -> list[Trial]:
    """Return the trials, with those fitted to their end that may be the best cause beside one with
    history.

    Args:
        evaluator: of the inference problem.
        trials: of a further cause each.
        against: the model that their gains are over.
        least: gain of each trial from which it is worth it [nats].
    """
    most = max((trial.gain for trial in trials), default=0.0)
    found = list(trials)
    for number, (trial, needed) in enumerate(zip(trials, least, strict=True)):
        chosen = trial.gain >= max(needed, CRITERIA.naming.unsettled * most)
        if chosen and trial.model.has_history and against.effects:
            nuisances = evaluator.problem.nuisances.precision
            worth = worth_while(evaluator, trial.model)
            model = settle(evaluator, trial.model, nuisances, worth)
            gain, misfit = gain_over(evaluator, model, against), evaluator.misfit(model)
            found[number] = replace(trial, model=model, gain=gain, misfit=misfit)
    return found


class HeldHistory(SharedEvaluator):
    """Evaluates further causes beside a model with history, whose change by the history is held.

    To first order its numbers may still change.

    Args:
        evaluator: of the inference problem.
        beside: fitted model with history.

    Attributes:
        plain: the same model without its effects with history.
    """

    def __init__(self, evaluator: Evaluator, beside: Model) -> None:
        super().__init__(evaluator)
        self._beside = beside
        self.plain = plain_model(evaluator, beside.effects, beside.predictions)

    def evaluate(
        self,
        effects: Sequence[Effect],
        starts: Sequence[Prediction] | None = None,
        tangents: Sequence[Tangent] = (),
        inclusions: Sequence[AnyInclusion] = (),
    ) -> Model:
        """Replay the effects without history, and add the change by those with history.

        Args:
            effects: of the model, in its order, and further ones without history.
            starts: plain predictions to begin from, one for each sequence.
            tangents: as for `Evaluator.evaluate`.
            inclusions: as for `Evaluator.evaluate`.
        """
        others = [effect for effect in effects if not effect.has_history()]
        plain = super().evaluate(others, starts, tangents, inclusions)
        rows = zip(plain.predictions, self.plain.predictions, self._beside.predictions, strict=True)
        predictions = [self._with_history(new, old, held, effects) for new, old, held in rows]
        setup = with_effects(self.problem.setup, effects)
        return self.assemble(effects, setup, predictions, tangents, len(inclusions))

    def _with_history(
        self, new: Prediction, old: Prediction, held: Prediction, effects: Sequence[Effect]
    ) -> Prediction:
        """Return a plain prediction with the change by the history.

        Args:
            new: plain prediction with all effects without history.
            old: plain prediction of the model beside.
            held: prediction of that model with its history.
            effects: in the order of the columns that are returned.
        """
        first = self.problem.blocks.replayed
        was = dict(zip(self._beside.names, self._beside.effects, strict=True))
        places = dict(zip(was, _places(self._beside.effects, first), strict=True))
        others = [effect for effect in effects if not effect.has_history()]
        own = dict(zip((e.name for e in others), _places(others, first), strict=True))
        shifted = new.transferred(held, old)
        ahead, there = _every_column(new), _every_column(held)
        parts, change = [ahead[..., :first]], np.zeros(ahead.shape[:2])
        for effect in effects:
            if effect.name in own:
                parts.append(ahead[..., own[effect.name]])
                continue
            columns = there[..., places[effect.name]]
            moved = np.subtract(effect.coordinates, was[effect.name].coordinates)
            parts.append(columns)
            change = change + columns @ moved
        parts.append(ahead[..., first + sum(len(effect.numbers()) for effect in others) :])
        patches = shifted.gap.shape[1]
        forces = shifted.forces
        if forces is not None:
            forces = replace(forces, gap=forces.gap + change[:, patches:])
        shifted = replace(shifted, gap=shifted.gap + change[:, :patches], forces=forces)
        return shifted.replace_columns(np.concatenate(parts, axis=2))


def _places(effects: Sequence[Effect], first: int) -> list[slice]:
    """Return the columns of each effect, from a first column on."""
    ends = np.cumsum([first, *(len(effect.numbers()) for effect in effects)]).tolist()
    return [slice(low, high) for low, high in pairwise(ends)]


def _every_column(item: Prediction) -> FloatArray:
    """Return the columns (g, p, k), with the force's rows last where forces were measured."""
    if item.forces is None:
        return item.columns
    return np.concatenate([item.columns, item.forces.columns], axis=1)


def gain_over(evaluator: Evaluator, model: Model, other: Model) -> float:
    """Return the gain of a model over another one [nats]."""
    return predictive_gain(evaluator.score(model), evaluator.score(other))[0]
