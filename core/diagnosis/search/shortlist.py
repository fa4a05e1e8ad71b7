"""Which candidates of a screening are refitted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.stats import chi2, norm

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import fit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.inference.inference_problem import Bench
from palpate.diagnosis.search.screening import Candidate
from palpate.effects import Effect
from palpate.effects.elastic_material import StiffInclusion
from palpate.effects.geometry import MeshResolution
from palpate.effects.tool import ToolOffset, ToolRadius

__all__ = ["beyond_first_order", "shortlist"]

_FAR_FROM_LINEAR: tuple[type[Effect], ...] = (ToolOffset, ToolRadius)
"""What moves where the tool meets the block."""


def beyond_first_order(
    bench: Bench, model: Model, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """What to refit whatever its linear gain: the tool's offset and radius, and what breaks its
    stated accuracy most.

    A tangent knows little of what a tool that is elsewhere, or another one, does over millimetres:
    of a shift of 2.4 mm it finds
    0.4, and for a ball of 3.4 mm that is said to have 5 it promises under 14 nats, a tool that
    gives way 282.
    """
    change = fit(bench.tempered(model), [*model.nuisance, *model.columns], bench.held(model)).change
    covariance = np.linalg.inv(bench.nuisances.precision)
    least, strained = 2 * float(norm.sf(CRITERIA.screening.strained)), []
    for candidate in candidates:
        own = [model.nuisance.index(column) for column in candidate.widened]
        pull = float(change[own] @ np.linalg.solve(covariance[np.ix_(own, own)], change[own]))
        chance = float(chi2.sf(pull, len(own))) if own else 1.0
        if chance < least and not isinstance(candidate.start, (*_FAR_FROM_LINEAR, MeshResolution)):
            least, strained = chance, [candidate]
    return [
        candidate for candidate in candidates if isinstance(candidate.start, _FAR_FROM_LINEAR)
    ] + strained


def shortlist(
    gains: np.ndarray,
    candidates: Sequence[Candidate],
    least: float,
    settled: Sequence[Candidate] = (),
) -> list[Candidate]:
    """The settled ones, then the best start of each promising effect, best first; two places for a
    lump.
    """
    chosen, names = list(settled), CRITERIA.screening.shortlist + len(settled)
    for number in np.argsort(-gains):
        candidate = candidates[number]
        taken = [c for c in chosen if c.start.name == candidate.start.name]
        apart = all(
            _distance(candidate.start, other.start) > CRITERIA.screening.inclusions_apart
            for other in taken
        )
        nothing_finer = isinstance(candidate.start, MeshResolution) and candidate.widened
        room = not (taken or nothing_finer) or (
            isinstance(candidate.start, StiffInclusion) and len(taken) < 2 and apart
        )
        if (
            gains[number] > least
            and room
            and (taken or len({c.start.name for c in chosen}) < names)
        ):
            chosen.append(candidate)
    return chosen


def _distance(one: Effect, other: Effect) -> float:
    if isinstance(one, StiffInclusion) and isinstance(other, StiffInclusion):
        return float(np.linalg.norm([one.x - other.x, one.y - other.y, one.z - other.z]))
    return 0.0
