"""Linear gains of all candidates.

All effects of the catalogue are columns of one linear problem: those with a derivative by their
sensitivities, the others by the difference between two replays. The gain of a candidate is the
predictive score of left-out blocks against that of the model without it. The same gains on data
drawn from the noise model alone give the bounds that a cause must exceed
(`palpate.diagnosis.search.chance_gains`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block
from palpate.effects import Effect
from palpate.foundation.arrays import FloatArray

__all__ = ["Candidate", "linear_gains", "pair_gains", "right_sides"]


@dataclass(frozen=True, eq=False, kw_only=True)
class Candidate:
    """An effect as columns of a model.

    Attributes:
        start: the effect that the columns change.
        of: name of the number whose search coordinate each column changes by one; without names
            the column is the whole change by `start`.
        columns: of the effect.
        spread: prior deviation of the factor of each column.
        widened: column of a nuisance that the effect shares to the deviation that widens its prior.
        refitted: whether a fit of the effect is possible.
    """

    start: Effect
    of: tuple[str, ...] = ()
    columns: tuple[int, ...] = ()
    spread: tuple[float, ...] = ()
    widened: dict[int, float] = field(default_factory=dict)
    refitted: bool = True

    def precision(self, nuisance: Sequence[int], known: FloatArray) -> tuple[list[int], FloatArray]:
        """Return the columns to use and their prior precision.

        Args:
            nuisance: columns of the nuisances.
            known: prior precision of the nuisances.
        """
        covariance = np.linalg.inv(known)
        for column, spread in self.widened.items():
            covariance[nuisance.index(column), nuisance.index(column)] += spread**2
        size = len(nuisance) + len(self.columns)
        precision = np.zeros((size, size))
        precision[: len(nuisance), : len(nuisance)] = np.linalg.inv(covariance)
        own = np.arange(len(nuisance), size)
        precision[own, own] = np.array(self.spread) ** -2.0
        return [*nuisance, *self.columns], precision

    def beside(self, other: Candidate) -> Candidate:
        """Return the same effect with the columns of another one after its own."""
        columns, spread = (*self.columns, *other.columns), (*self.spread, *other.spread)
        return replace(
            self, columns=columns, spread=spread, widened={**self.widened, **other.widened}
        )


def right_sides(blocks: Sequence[Block]) -> FloatArray:
    """Return the right sides (1, b, k) of the data."""
    return np.array([[block.gram[1:, 0] for block in blocks]])


def _values(
    blocks: Sequence[Block],
    rights: FloatArray,
    columns: Sequence[int],
    precision: FloatArray,
    known: FloatArray,
) -> FloatArray:
    """Return the log predictive density (d,), summed over blocks and the stated accuracies.

    Terms that no column changes are left out.
    """
    index = np.asarray(columns)
    grams = np.array([block.gram[1:, 1:][np.ix_(index, index)] for block in blocks])
    rights = rights[:, :, index]

    def evidence(matrix: FloatArray, right: FloatArray, prior: FloatArray) -> FloatArray:
        full = matrix + prior
        explained = np.einsum("di,ij,dj->d", right, np.linalg.inv(full), right)
        return np.asarray(
            0.5 * explained - 0.5 * (np.linalg.slogdet(full)[1] - np.linalg.slogdet(prior)[1])
        )

    matrix, right = grams.sum(axis=0), rights.sum(axis=1)
    total = (len(blocks) + 1) * evidence(matrix, right, precision)
    for number in range(len(blocks)):
        total -= evidence(matrix - grams[number], right - rights[:, number], precision)
    # The same flat prior for every candidate, whatever it widens, so that the scores compare.
    free = precision.copy()
    free[: len(known), : len(known)] = CRITERIA.priors.flat_factor * known
    return np.asarray(total - evidence(matrix, right, free))


def linear_gains(
    blocks: Sequence[Block],
    rights: FloatArray,
    nuisance: Sequence[int],
    known: FloatArray,
    candidates: Sequence[Candidate],
) -> FloatArray:
    """Return the gain (d, c) [nats] of each candidate for each set of right sides (d, b, k)."""
    baseline = _values(blocks, rights, nuisance, known, known)
    return np.stack(
        [
            _values(blocks, rights, *c.precision(list(nuisance), known), known) - baseline
            for c in candidates
        ],
        axis=1,
    )


def pair_gains(
    blocks: Sequence[Block],
    rights: FloatArray,
    nuisance: Sequence[int],
    known: FloatArray,
    candidates: Sequence[Candidate],
    more: float = -np.inf,
) -> list[tuple[float, Candidate, Candidate]]:
    """Return the gain [nats] of every two effects together, by their best candidates, best first.

    Args:
        blocks: of the model.
        rights: one set of right sides (1, b, k).
        nuisance: columns of the nuisances.
        known: their prior precision.
        candidates: to be paired.
        more: pairs must gain this much more than the best candidate alone.
    """
    least = linear_gains(blocks, rights, nuisance, known, candidates).max() + more
    pairs = [
        (one, other)
        for one, other in combinations(candidates, 2)
        if one.start.name != other.start.name
    ]
    gains = linear_gains(
        blocks, rights, nuisance, known, [one.beside(other) for one, other in pairs]
    )[0].tolist()
    found: dict[frozenset[str], tuple[float, Candidate, Candidate]] = {}
    for gain, (one, other) in sorted(zip(gains, pairs, strict=True), key=lambda row: -row[0]):
        if gain > least:
            found.setdefault(frozenset((one.start.name, other.start.name)), (gain, one, other))
    return list(found.values())
