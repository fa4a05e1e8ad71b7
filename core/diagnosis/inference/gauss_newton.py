"""Fitting a hypothesis: Gauss-Newton with a trust region, and a look beyond the kinks that
derivatives do not see.

A push that slides the base at one friction holds at a slightly higher one. Just below, the fit has
a kink: to first order no step promises anything, and a few percent away lies a friction that is
better by a hundred nats. So where an effect has kinks, a fit that has come to rest is asked again a
little to either side (a poll step of a direct search; Kolda, Lewis and Torczon 2003).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import explained, within_reach
from palpate.diagnosis.inference.hypothesis import Model
from palpate.effects import Effect
from palpate.foundation.arrays import FloatArray

if TYPE_CHECKING:
    from palpate.diagnosis.inference.inference_problem import Bench

__all__ = ["fitted"]


def fitted(
    bench: Bench,
    model: Model,
    nuisances: FloatArray,
    hopeless: float = -np.inf,
    worth: float = CRITERIA.fits.worth,
) -> Model:
    """The best model met from here on; one whose log evidence will hardly reach `hopeless` is given
    up.
    """
    found = _descended(bench, model, nuisances, hopeless, worth)
    for _ in range(CRITERIA.fits.polls):
        better = _polled(bench, found, nuisances, hopeless, worth)
        if better is None:
            break
        found = _descended(bench, better, nuisances, hopeless, worth)
    return found


def _descended(
    bench: Bench, model: Model, nuisances: FloatArray, hopeless: float, worth: float
) -> Model:
    """Gauss-Newton."""
    best, radius = bench.objective(model, nuisances), CRITERIA.fits.trust
    for iteration in range(CRITERIA.fits.iterations):
        promised = _promised(bench, model, nuisances)
        lost = best + CRITERIA.fits.optimism[min(iteration, 1)] * promised < hopeless or (
            iteration == 2 and best < hopeless
        )
        if lost or promised < worth:
            break
        step = _step(bench, model, nuisances, radius)
        if np.abs(step / model.scales).max() < CRITERIA.fits.least_step:
            break
        trial = bench.evaluate(_shifted(model, step), model.predictions)
        value = bench.objective(trial, nuisances)
        if value > best:
            gained, model, best = value - best, trial, value
            if gained < 2 * worth:
                break
        else:
            radius = CRITERIA.fits.shrinking * np.abs(step / model.scales).max()
            if radius < CRITERIA.fits.least_trust:
                break
    return model


def _polled(
    bench: Bench, model: Model, nuisances: FloatArray, hopeless: float, worth: float
) -> Model | None:
    """The first model a little to a side that is better, None without one, or where the fit was
    given up.
    """
    best = bench.objective(model, nuisances)
    if best < hopeless:
        return None
    for step in _aside(model):
        trial = bench.evaluate(_shifted(model, step), model.predictions)
        if bench.objective(trial, nuisances) > best + worth:
            return trial
    return None


def _aside(model: Model) -> Iterator[FloatArray]:
    """Steps to either side along each number of an effect that has kinks."""
    kinked = [effect.kinked for effect in model.effects for _ in effect.numbers()]
    for row in np.flatnonzero(kinked):
        for way in (CRITERIA.fits.poll_step, -CRITERIA.fits.poll_step):
            step = np.zeros(len(model.scales))
            step[row] = way * model.scales[row]
            yield step


def _step(bench: Bench, model: Model, nuisances: FloatArray, reach: float) -> FloatArray:
    """Most probable change of the search coordinates, none by more than `reach` of its scales."""
    columns, first = [*model.nuisance, *model.columns], len(model.nuisance)
    own, precision = range(first, len(columns)), bench.held(model, nuisances)
    return within_reach(bench.tempered(model), columns, precision, own, model.scales, reach)[first:]


def _promised(bench: Bench, model: Model, nuisances: FloatArray) -> float:
    """What the best values of the model's search coordinates would gain to first order [nats]."""
    blocks, whole = bench.tempered(model), bench.held(model, nuisances)
    return explained(blocks, [*model.nuisance, *model.columns], whole) - explained(
        blocks, model.nuisance, nuisances
    )


def _shifted(model: Model, step: FloatArray) -> Sequence[Effect]:
    effects, at = [], 0
    for effect in model.effects:
        number = len(effect.numbers())
        effects.append(effect.at((np.array(effect.coordinates) + step[at : at + number]).tolist()))
        at += number
    return effects
