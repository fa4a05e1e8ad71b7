"""Fits of a hypothesis by Gauss-Newton with a trust region, followed by a poll around kinks.

A push that slides the base at one friction holds at a slightly higher one. Just below that friction
the objective has a kink: no step promises a gain to first order, and a friction a few percent away
is better by a hundred nats. Where an effect has kinks, a fit that has converged is therefore tried
again a little to either side (a poll step of a direct search; Kolda, Lewis and Torczon 2003).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.evidence import explained, within_reach
from palpate.diagnosis.inference.hypothesis import Model
from palpate.effects import Effect
from palpate.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from palpate.diagnosis.inference.evaluate import Evaluator

__all__ = ["best_fit", "refit", "worth_while"]


def refit(
    evaluator: Evaluator,
    effects: Sequence[Effect],
    starts: Sequence[Prediction] | None,
    hopeless: float = -np.inf,
) -> Model:
    """Fit the numbers of these effects and return the best model met.

    Args:
        evaluator: of the inference problem.
        effects: as the fit starts.
        starts: predictions to begin from, one for each sequence.
        hopeless: a model whose log evidence will hardly reach this [nats] is given up.
    """
    evaluator.report(f"fitting {' and '.join(effect.name for effect in effects)}")
    model = evaluator.evaluate(effects, starts)
    nuisances = evaluator.problem.nuisances.precision
    return best_fit(evaluator, model, nuisances, hopeless, worth_while(evaluator, model))


def worth_while(evaluator: Evaluator, model: Model) -> float:
    """Return what a step must promise to be made while models are compared [nats].

    It is half the distance of rivals at most, so that what is left open does not change their
    order.
    """
    gained = evaluator.objective(model) - evaluator.state.stated
    least = min(CRITERIA.fits.worth_share * gained, CRITERIA.naming.rival / 2)
    return max(CRITERIA.fits.worth, least)


def best_fit(
    evaluator: Evaluator,
    model: Model,
    nuisances: FloatArray,
    hopeless: float = -np.inf,
    worth: float = CRITERIA.fits.worth,
) -> Model:
    """Return the best model met in a fit that starts from this one.

    Args:
        evaluator: of the inference problem.
        model: to start from.
        nuisances: prior precision of the nuisances.
        hopeless: a model whose log evidence will hardly reach this [nats] is given up.
        worth: a step that promises less [nats] is not made.
    """
    return _Fit(evaluator, model, nuisances, hopeless, worth).best_from(model)


class _Fit:
    """One fit: its bounds, and the work that it may do.

    Args:
        evaluator: of the inference problem.
        model: whose effects are fitted.
        nuisances: prior precision of the nuisances.
        hopeless: a model whose log evidence will hardly reach this [nats] is given up.
        worth: a step that promises less [nats] is not made.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        model: Model,
        nuisances: FloatArray,
        hopeless: float,
        worth: float,
    ) -> None:
        self._evaluator, self._nuisances = evaluator, nuisances
        self._hopeless, self._worth, self._names = hopeless, worth, model.names
        most = CRITERIA.fits.most_work[min(len(model.effects), 2) - 1]
        self._most_work = evaluator.state.work + most * evaluator.state.unit

    def best_from(self, model: Model) -> Model:
        """Return the best model met from this one on."""
        best = self._descended(model)
        for _ in range(CRITERIA.fits.polls):
            better = self._polled(best)
            if better is None:
                break
            best = self._descended(better)
        return best

    def _is_spent(self) -> bool:
        """Return whether the fit must end for its work; it is then noted."""
        state = self._evaluator.state
        if state.work > self._most_work:
            state.cut_short.add(self._names)
        return state.work > self._most_work

    def _objective(self, model: Model) -> float:
        return self._evaluator.objective(model, self._nuisances)

    def _descended(self, model: Model) -> Model:
        """Return the model after Gauss-Newton steps."""
        best, radius = self._objective(model), CRITERIA.fits.trust
        for iteration in range(CRITERIA.fits.iterations):
            promised = _promised(self._evaluator, model, self._nuisances)
            optimism = CRITERIA.fits.optimism[min(iteration, 1)]
            lost = best + optimism * promised < self._hopeless or (
                iteration == 2 and best < self._hopeless
            )
            if lost or promised < self._worth or self._is_spent():
                break
            step = _step(self._evaluator, model, self._nuisances, radius)
            if np.abs(step / model.scales).max() < CRITERIA.fits.least_step:
                break
            trial = _shifted(self._evaluator, model, step)
            value = self._objective(trial)
            if value > best:
                gained, model, best = value - best, trial, value
                if gained < 2 * self._worth:
                    break
            else:
                radius = CRITERIA.fits.shrinking * np.abs(step / model.scales).max()
                if radius < CRITERIA.fits.least_trust:
                    break
        return model

    def _polled(self, model: Model) -> Model | None:
        """Return the first better model a little to a side; None if there is none.

        None also for a fit that was given up.
        """
        best = self._objective(model)
        if best < self._hopeless:
            return None
        for step in _poll_steps(model):
            if self._is_spent():
                break
            trial = _shifted(self._evaluator, model, step)
            if self._objective(trial) > best + self._worth:
                return trial
        return None


def _poll_steps(model: Model) -> Iterator[FloatArray]:
    """Yield steps to either side along each number of an effect that has kinks."""
    kinked = [effect.kinked for effect in model.effects for _ in effect.numbers()]
    for row in np.flatnonzero(kinked):
        for way in (CRITERIA.fits.poll_step, -CRITERIA.fits.poll_step):
            step = np.zeros(len(model.scales))
            step[row] = way * model.scales[row]
            yield step


def _step(evaluator: Evaluator, model: Model, nuisances: FloatArray, reach: float) -> FloatArray:
    """Return the most probable change of the search coordinates, at most `reach` scales each."""
    columns, first = [*model.nuisance, *model.columns], len(model.nuisance)
    own, precision = range(first, len(columns)), evaluator.bounded_precision(model, nuisances)
    blocks = evaluator.tempered(model)
    return within_reach(blocks, columns, precision, own, model.scales, reach)[first:]


def _promised(evaluator: Evaluator, model: Model, nuisances: FloatArray) -> float:
    """Return the gain of the best search coordinates to first order [nats]."""
    blocks, whole = evaluator.tempered(model), evaluator.bounded_precision(model, nuisances)
    return explained(blocks, [*model.nuisance, *model.columns], whole) - explained(
        blocks, model.nuisance, nuisances
    )


def _shifted(evaluator: Evaluator, model: Model, step: FloatArray) -> Model:
    """Return the model with its search coordinates a step further."""
    return evaluator.evaluate(model.effects_at(model.coordinates + step), model.predictions)
