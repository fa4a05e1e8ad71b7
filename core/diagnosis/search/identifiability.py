"""Identifiability of effects by an experiment: detection limits, and effects that look alike.

Both follow from the columns of the screening alone, before any data is judged: the same motions,
noise and stated accuracies, with an imagined cause as the only error. Discrepancy and nuisances
belong in it (Kennedy and O'Hagan 2001).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from palpate.diagnosis.inference.evidence import Block
from palpate.diagnosis.search.screening import Candidate, linear_gains
from palpate.effects import Effect, Parameter
from palpate.foundation.arrays import FloatArray

__all__ = ["Identifiability", "Limit", "detection_limits", "identifiability_of", "mimicry"]


@dataclass(frozen=True, kw_only=True)
class Limit:
    """The smallest cause of one kind that would gain the bound.

    Attributes:
        item: number that is changed; None for a share of the change by a finite effect.
        size: change of its search coordinate, or the share [1]; infinite where no change within
            the parameter's bounds would be seen.
    """

    item: Parameter | None
    size: float

    def to_json(self) -> dict[str, Any]:
        """Return `change`, `factor` or `share` for the report; None where no size would be seen."""
        if self.item is None:
            return {"share": _rounded(self.size)}
        factor = self.item.factor(self.size)
        size = {"change": _rounded(self.size)} if factor is None else {"factor": _rounded(factor)}
        return {"parameter": self.item.name, "unit": self.item.unit, **size}


@dataclass(frozen=True, eq=False)
class Identifiability:
    """Identifiability of one effect.

    Attributes:
        candidate: the candidate of the effect that is seen best.
        limits: detection limits of its parameters.
        typical: first limit that half of the effect's candidates reach (places of an inclusion,
            edges of a base).
        each: every candidate's start with its first limit, where there are several.
        alike: name of every other effect to the share of this one's change that it imitates [1].
    """

    candidate: Candidate
    limits: tuple[Limit, ...]
    typical: Limit
    each: tuple[tuple[Effect, Limit], ...] = ()
    alike: dict[str, float] = field(default_factory=dict)

    @property
    def effect(self) -> str:
        """Name of the effect."""
        return self.candidate.start.name

    def to_json(self) -> dict[str, Any]:
        """Return the entry of the report; the effect that imitates it most comes first."""
        rows = sorted(self.alike.items(), key=lambda row: -row[1])
        return {
            "effect": self.effect,
            "limits": [limit.to_json() for limit in self.limits],
            "typical": self.typical.to_json(),
            "at": self._fixed(self.candidate.start),
            "each": [
                {"at": self._fixed(start), "limit": limit.to_json()} for start, limit in self.each
            ],
            "alike": [{"effect": name, "share": round(share, 4)} for name, share in rows],
        }

    def _fixed(self, start: Effect) -> dict[str, Any]:
        """Return the parameters without a limit."""
        moved = {limit.item.name for limit in self.limits if limit.item is not None}
        return {
            item.name: {"value": getattr(start, item.name), "unit": item.unit}
            for item in start.parameters()
            if item.name not in moved
        }


def _rounded(size: float) -> float | None:
    return float(f"{size:.3g}") if math.isfinite(size) else None


def identifiability_of(
    blocks: Sequence[Block],
    nuisance: Sequence[int],
    known: FloatArray,
    candidates: Sequence[Candidate],
    bound: float,
) -> tuple[Identifiability, ...]:
    """Return one entry for each effect among the candidates, in their order.

    Args:
        blocks: of the screening.
        nuisance: columns of the nuisances.
        known: prior precision (n, n) of the nuisance columns.
        candidates: of the screening.
        bound: gain from which a cause is named [nats].
    """
    groups: dict[str, list[Candidate]] = {}
    for candidate in candidates:
        groups.setdefault(candidate.start.name, []).append(candidate)
    found = []
    for name, group in groups.items():
        limits = [
            detection_limits(blocks, nuisance, known, candidate, bound) for candidate in group
        ]
        order = np.argsort([own[0].size for own in limits])
        candidate, typical = group[order[0]], limits[order[len(order) // 2]][0]
        each = (
            tuple((one.start, own[0]) for one, own in zip(group, limits, strict=True))
            if len(group) > 1
            else ()
        )
        alike = {
            other: max(mimicry(blocks, nuisance, known, candidate, rival) for rival in group)
            for other, group in groups.items()
            if other != name
        }
        found.append(Identifiability(candidate, limits[order[0]], typical, each, alike))
    return tuple(found)


def detection_limits(
    blocks: Sequence[Block],
    nuisance: Sequence[int],
    known: FloatArray,
    candidate: Candidate,
    bound: float,
) -> tuple[Limit, ...]:
    """Return the size of each of a candidate's changes, alone, at which its gain is the bound.

    The gain grows with the square of the size. Arguments as for `identifiability_of`.
    """
    found, numbers = [], {item.name: item for item in candidate.start.numbers()}
    own = [*candidate.widened, *candidate.columns]
    spreads = [*candidate.widened.values(), *candidate.spread]
    for place, (column, spread) in enumerate(zip(own, spreads, strict=True)):
        right = np.array([block.gram[1:, 1 + column] for block in blocks]) * spread
        nothing, something = linear_gains(
            blocks, np.array([0 * right, right]), nuisance, known, [candidate]
        )[:, 0]
        risen = float(something - nothing)
        size = (
            spread * math.sqrt(max(bound - float(nothing), 0.0) / risen) if risen > 0 else math.inf
        )
        if not candidate.of:
            found.append(Limit(item=None, size=size))
            continue
        item = numbers[candidate.of[place]]
        widest = item.coordinate(item.high) - (0.0 if item.contrast else item.coordinate(item.low))
        found.append(Limit(item=item, size=size if size <= widest else math.inf))
    return tuple(found)


def mimicry(
    blocks: Sequence[Block],
    nuisance: Sequence[int],
    known: FloatArray,
    candidate: Candidate,
    rival: Candidate,
) -> float:
    """Return the share [1] of a candidate's change that a rival imitates.

    It is R squared with all nuisances free within their accuracy, and 1 for nuisances that both
    widen. Each of several changes counts by its size at its prior's deviation. Arguments as for
    `identifiability_of`.
    """
    own, other = [*candidate.widened, *candidate.columns], [*rival.widened, *rival.columns]
    total = np.sum([block.gram[1:, 1:] for block in blocks], axis=0)
    rest = [column for column in nuisance if column not in own and column not in other]
    index = [nuisance.index(column) for column in rest]
    prior = np.linalg.inv(np.linalg.inv(known)[np.ix_(index, index)])
    kept = [*own, *other]
    aside = np.linalg.solve(total[np.ix_(rest, rest)] + prior, total[np.ix_(rest, kept)])
    left = total[np.ix_(kept, kept)] - total[np.ix_(kept, rest)] @ aside
    mine, shared, theirs = (
        left[: len(own), : len(own)],
        left[: len(own), len(own) :],
        left[len(own) :, len(own) :],
    )
    spread = np.array([*candidate.widened.values(), *candidate.spread])
    imitated = shared @ np.linalg.pinv(theirs, hermitian=True) @ shared.T
    return float(
        np.clip(spread**2 @ np.diag(imitated) / max(spread**2 @ np.diag(mine), 1e-300), 0.0, 1.0)
    )
