"""The effect from which a fit starts, by the linear fit of its columns."""

from __future__ import annotations

import math

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import within_reach
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.posterior import Posterior
from palpate.diagnosis.search.screening import Candidate
from palpate.effects import Effect

__all__ = ["initial_guess"]


def initial_guess(
    candidate: Candidate, model: Model, posterior: Posterior, beside: Candidate | None = None
) -> Effect:
    """Return the effect from which the fit of a candidate starts.

    Args:
        candidate: of the model's linear problem.
        model: with the columns.
        posterior: of the inference problem.
        beside: another candidate that is fitted with it.
    """
    together = candidate if beside is None else candidate.beside(beside)
    precision = posterior.problem.nuisances.precision
    columns, prior = together.precision(list(model.nuisance), precision)
    limits = {
        column: scale
        for one in (candidate, beside)
        if one
        for column, scale in _limited(one).items()
    }
    own, scales = [columns.index(column) for column in limits], np.array(list(limits.values()))
    blocks, reach = posterior.tempered(model), CRITERIA.fits.trust
    step = within_reach(blocks, columns, prior, own, scales, reach)
    start = candidate.start
    if limited := _limited(candidate):
        changes = [float(step[columns.index(column)]) for column in limited]
        names = (item.name for item in start.numbers())
        return start.initial_guess(dict(zip(names, changes, strict=True)))
    change = float(step[columns.index(candidate.columns[-1])])
    if not candidate.of:
        least, most = CRITERIA.screening.least_share, CRITERIA.screening.most_share
        return start.scaled(float(np.clip(change, least, most)))
    (name,) = candidate.of
    return start.initial_guess({name: _plausible(start, name, change)})


def _limited(candidate: Candidate) -> dict[int, float]:
    """Return the columns whose change is limited to a fit's first step, with their scales.

    These are the columns of effects all of whose numbers are fitted at once.
    """
    columns = candidate.widened or (
        candidate.columns if candidate.start.joint and candidate.of else ()
    )
    return dict(
        zip(columns, (item.scale for item in candidate.start.numbers()), strict=bool(columns))
    )


def _plausible(start: Effect, name: str, change: float) -> float:
    """Return the change of a number's search coordinate, clipped to what is plausible."""
    item = next(item for item in start.numbers() if item.name == name)
    farthest = math.inf
    if item.log:
        farthest = CRITERIA.screening.farthest_log
    elif item.contrast:
        farthest = CRITERIA.screening.farthest_contrast
    return float(np.clip(change, -farthest, farthest))
