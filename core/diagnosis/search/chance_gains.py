"""The gain that chance alone can give each effect, from draws of the noise model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Self

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block, draw_rights
from palpate.diagnosis.search.screening import Candidate, linear_gains
from palpate.foundation.arrays import FloatArray

__all__ = ["ChanceGains"]


@dataclass(frozen=True, eq=False)
class ChanceGains:
    """Linear gains of effects on draws that hold noise, discrepancy and nuisances, and no cause.

    Attributes:
        names: of the effects (e).
        gains: of the best candidate of each effect on each draw (d, e) [nats].
    """

    names: tuple[str, ...] = ()
    gains: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))

    @classmethod
    def drawn(
        cls,
        blocks: Sequence[Block],
        nuisance: Sequence[int],
        known: FloatArray,
        candidates: Sequence[Candidate],
        draws: int,
        seed: int,
    ) -> Self:
        """Draw the gains.

        Args:
            blocks: of the screening.
            nuisance: columns of the nuisances.
            known: their prior precision.
            candidates: of the screening.
            draws: number of draws.
            seed: of the draws.
        """
        rights = draw_rights(blocks, nuisance, known, draws, np.random.default_rng(seed))
        every = linear_gains(blocks, rights, nuisance, known, candidates)
        names = tuple(dict.fromkeys(candidate.start.name for candidate in candidates))
        own = [
            [place for place, one in enumerate(candidates) if one.start.name == name]
            for name in names
        ]
        return cls(names, np.stack([every[:, places].max(axis=1) for places in own], axis=1))

    @property
    def best(self) -> FloatArray:
        """Best gain in the catalogue of each draw (d,) [nats]."""
        return np.asarray(self.gains.max(axis=1)) if self.gains.size else np.zeros(0)

    @property
    def bound(self) -> float:
        """Gain [nats] that the best of the catalogue rarely has by chance."""
        quantile = float(np.quantile(self.best, CRITERIA.naming.null_quantile))
        return max(quantile, CRITERIA.naming.least_gain)

    def bounds(self) -> dict[str, float]:
        """Return the gain [nats] that each effect rarely has by chance.

        All effects together exceed theirs in as many datasets as the best of the catalogue exceeds
        `bound`, and each of them equally often. That is rarer than one of the draws: the tail of
        each effect's gains is continued as an exponential one, which that of chi squared
        approaches.
        """
        if not self.gains.size:
            return {}
        share = (1.0 - CRITERIA.naming.null_quantile) / len(self.names)
        tail = CRITERIA.naming.null_tail
        starts = np.quantile(self.gains, 1.0 - tail, axis=0)
        found = {}
        for name, start, gains in zip(self.names, starts.tolist(), self.gains.T, strict=True):
            length = float(np.mean(gains[gains > start] - start)) if (gains > start).any() else 0.0
            bound = start + length * np.log(tail / share)
            found[name] = max(float(bound), CRITERIA.naming.least_confirmed_gain)
        return found

    def named(self, bounds: Mapping[str, float]) -> int:
        """Return the number of draws in which an effect exceeds its bound [nats]."""
        limits = np.array([bounds[name] for name in self.names])
        return int((self.gains > limits).any(axis=1).sum())
