"""The candidates of a screening that are refitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2, norm

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.posterior import Posterior
from palpate.diagnosis.search.screening import Candidate
from palpate.effects import Effect, Linearisation
from palpate.foundation.arrays import FloatArray

__all__ = ["beyond_first_order", "shortlist"]


def beyond_first_order(
    posterior: Posterior, model: Model, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Return the candidates to refit whatever their linear gain.

    They are the strongly nonlinear effects, and the effect that breaks its stated accuracy most: to
    first order a nuisance explains most of it.

    Args:
        posterior: of the inference problem.
        model: with the columns.
        candidates: of the screening.
    """
    columns, precision = [*model.nuisance, *model.columns], posterior.bounded_precision(model)
    change = fit(posterior.tempered(model), columns, precision).change
    covariance = np.linalg.inv(posterior.problem.nuisances.precision)
    least, strained = 2 * float(norm.sf(CRITERIA.screening.strained)), []
    for candidate in candidates:
        own = [model.nuisance.index(column) for column in candidate.widened]
        pull = float(change[own] @ np.linalg.solve(covariance[np.ix_(own, own)], change[own]))
        chance = float(chi2.sf(pull, len(own))) if own else 1.0
        if chance < least and candidate.refitted and not candidate.start.strongly_nonlinear:
            least, strained = chance, [candidate]
    return [candidate for candidate in candidates if candidate.start.strongly_nonlinear] + strained


def shortlist(
    gains: np.ndarray,
    candidates: Sequence[Candidate],
    least: float | FloatArray,
    settled: Sequence[Candidate] = (),
) -> list[Candidate]:
    """Return the best start of each promising effect, best first; of an inclusion two places.

    Inclusions of all shapes take the place of one effect. One of another shape than a ball is left
    out behind a ball: it has better starts once the ball is fitted.

    Args:
        gains: linear gain (c,) of each candidate [nats].
        candidates: of the screening.
        least: gain of a promising effect [nats]; one for all, or one for each candidate (c,).
        settled: candidates that come first and take nobody's place.
    """
    chosen, names = list(settled), CRITERIA.screening.shortlist + len(settled)
    enough = gains > least
    for number in np.argsort(-gains):
        candidate = candidates[number]
        taken = [c for c in chosen if c.start.name == candidate.start.name]
        apart = all(
            _distance(candidate.start, other.start) > CRITERIA.screening.inclusions_apart
            for other in taken
        )
        kinds, ball = {_kind(c) for c in chosen}, candidate.start.inclusion is not None
        alone = _kind(candidate) not in kinds
        room = (not taken and candidate.refitted and (alone or ball)) or (
            ball and len(taken) < 2 and apart
        )
        if enough[number] and room and (not alone or len(kinds) < names):
            chosen.append(candidate)
    return chosen


def _kind(candidate: Candidate) -> str:
    """Return the name of a candidate's effect, or the linearisation that inclusions share."""
    start = candidate.start
    alike = start.linearisation is Linearisation.LOCAL_STIFFNESS
    return start.linearisation.value if alike else start.name


def _distance(one: Effect, other: Effect) -> float:
    """Return the distance between the inclusions of two effects [m]; zero without."""
    first, second = one.inclusion, other.inclusion
    if first is None or second is None:
        return 0.0
    return float(np.linalg.norm([first.x - second.x, first.y - second.y, first.z - second.z]))
