"""Posterior of the stiffness of many cells: a Gaussian field whose size and smoothness are averaged
by their evidence.

The field is the contrast (k - 1) / (k + 3/2) of the stiffness ratio k, by which forces and surfaces
change in proportion. Its prior has the correlation of Matern with the exponent 3/2 (Rasmussen and
Williams 2006, chapter 4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial.distance import cdist

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.evidence import Block, draw_rights
from palpate.foundation.arrays import FloatArray

__all__ = ["FieldPosterior", "field_posterior"]


@dataclass(frozen=True, eq=False)
class FieldPosterior:
    """The contrast of m cells, given the data.

    Attributes:
        mean: (m,) [1].
        covariance: (m, m).
        prior: (m, m) covariance before the data.
        felt: (m,) information of the data on each cell.
        gain: log evidence of the best size and length against a uniform body [nats].
        bound: gain that a uniform body has by chance in a stated share of datasets [nats].
        length: correlation length, averaged by evidence [m].
        deviation: prior deviation of the contrast, averaged likewise [1].
        misfit: of the data that the mean leaves; that of a uniform body less what it explains.
    """

    mean: FloatArray
    covariance: FloatArray
    prior: FloatArray
    felt: FloatArray
    gain: float
    bound: float
    length: float
    deviation: float
    misfit: float


@dataclass(frozen=True, eq=False)
class _Marginal:
    """Quadratic form of the cells with all other parameters integrated out.

    Attributes:
        matrix: (m, m).
        right: (m,).
        drawn: (d, m) right sides of a uniform body with noise.
        misfit: of the uniform body.
    """

    matrix: FloatArray
    right: FloatArray
    drawn: FloatArray
    misfit: float


def field_posterior(
    blocks: Sequence[Block],
    fitted: Sequence[int],
    precision: FloatArray,
    cells: Sequence[int],
    centres: FloatArray,
    scale: float,
    seed: int,
) -> FieldPosterior:
    """Return the posterior of a field.

    Args:
        blocks: of data.
        fitted: columns of the other parameters.
        precision: of their prior.
        cells: columns of the cells, the change by their contrast.
        centres: (m, 3) of the cells [m].
        scale: length of which the tried correlation lengths are multiples [m].
        seed: of the draws of a uniform body.
    """
    criteria = CRITERIA.stiffness_map
    data = _marginal(blocks, fitted, precision, cells, seed)
    apart = cdist(centres, centres)
    tried, chance = [], np.full(len(data.drawn), -np.inf)
    for length, deviation in product(scale * np.array(criteria.lengths), criteria.deviations):
        prior = deviation**2 * _correlation(apart, length)
        root = np.linalg.cholesky(prior + criteria.jitter * deviation**2 * np.eye(len(prior)))
        values, vectors = np.linalg.eigh(root.T @ data.matrix @ root)
        values, shape = np.maximum(values, 0.0), root @ vectors
        occam = 0.5 * np.log1p(values).sum()
        rights = np.vstack([data.right, data.drawn]) @ shape
        gains = 0.5 * (rights**2 / (1 + values)).sum(axis=1) - occam
        chance = np.maximum(chance, gains[1:])
        covariance = (shape / (1 + values)) @ shape.T
        tried.append((gains[0], length, deviation, -covariance @ data.right, covariance, prior))
    gains = np.array([one[0] for one in tried])
    weights = np.exp(gains - gains.max())
    weights /= weights.sum()
    kept = [
        (weight, *one)
        for weight, one in zip(weights, tried, strict=True)
        if weight > criteria.least_weight
    ]
    mean = sum(weight * one[3] for weight, *one in kept)
    covariance = sum(
        weight * (one[4] + np.outer(one[3] - mean, one[3] - mean)) for weight, *one in kept
    )
    explained = 2 * data.right @ mean + mean @ data.matrix @ mean
    return FieldPosterior(
        mean=np.asarray(mean),
        covariance=np.asarray(covariance),
        prior=np.asarray(sum(weight * one[5] for weight, *one in kept)),
        felt=np.diag(data.matrix).copy(),
        gain=float(gains.max()),
        bound=max(float(np.quantile(chance, criteria.quantile)), criteria.least_gain),
        length=float(sum(weight * one[1] for weight, *one in kept)),
        deviation=float(sum(weight * one[2] for weight, *one in kept)),
        misfit=data.misfit + float(explained),
    )


def _marginal(
    blocks: Sequence[Block],
    fitted: Sequence[int],
    precision: FloatArray,
    cells: Sequence[int],
    seed: int,
) -> _Marginal:
    """Integrate out all parameters but the cells; arguments as for `field_posterior`."""
    total = np.sum([block.gram for block in blocks], axis=0)
    own, others = np.asarray(cells) + 1, np.asarray(fitted) + 1
    cross = total[np.ix_(own, others)]
    solved = np.linalg.solve(total[np.ix_(others, others)] + precision, cross.T).T
    random = np.random.default_rng([seed, 71])
    drawn = draw_rights(blocks, list(fitted), precision, CRITERIA.stiffness_map.draws, random).sum(
        axis=1
    )
    inner = np.linalg.solve(total[np.ix_(others, others)] + precision, total[others, 0])
    return _Marginal(
        matrix=total[np.ix_(own, own)] - solved @ cross.T,
        right=total[own, 0] - solved @ total[others, 0],
        drawn=drawn[:, own - 1] - drawn[:, others - 1] @ solved.T,
        misfit=float(total[0, 0] - total[others, 0] @ inner),
    )


def _correlation(apart: FloatArray, length: float) -> FloatArray:
    """Correlation (...) of Matern with the exponent 3/2 at distances (...) [m]."""
    way = np.sqrt(3.0) * apart / length
    return np.asarray((1 + way) * np.exp(-way))
