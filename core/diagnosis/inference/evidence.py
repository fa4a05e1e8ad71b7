"""Gaussian evidence from quadratic forms, which hold all that a linearised sequence can say.

Residuals and columns of one block of data (a sequence, or the rest cloud) are whitened, and each
patch's own constant is projected out (the camera's fixed pattern). What remains is the Gram matrix
of [residual, columns]. Fits, predictive densities of left-out blocks and draws under the null
hypothesis follow from sums of such matrices.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from palpate.diagnosis.criteria import CRITERIA
from palpate.foundation.arrays import FloatArray

__all__ = [
    "Block",
    "Fit",
    "draw_rights",
    "explained",
    "fit",
    "gram",
    "less_constants",
    "log_evidence",
    "predictive_gain",
    "predictive_score",
    "within_reach",
]


@dataclass(frozen=True, eq=False)
class Block:
    """One block of data.

    Attributes:
        name: of the sequence, or "rest".
        gram: Gram matrix (1 + k, 1 + k) of the whitened residual and its k columns.
        values: number of independent values.
    """

    name: str
    gram: FloatArray
    values: float


def gram(
    residual: FloatArray, columns: FloatArray, weights: FloatArray, centred: bool = True
) -> tuple[FloatArray, float]:
    """Return the Gram matrix (1 + k, 1 + k) of residual and columns, and the number of values.

    The constants that are taken out are not counted.

    Args:
        residual: (g, p) [m].
        columns: (g, p, k).
        weights: inverse variances (g, p) [1/m^2], zero where unseen.
        centred: whether each patch's weighted mean over the groups is taken out.
    """
    stacked = np.concatenate([np.where(weights > 0, residual, 0.0)[..., None], columns], axis=2)
    taken = float((weights.sum(axis=0) > 0).sum()) if centred else 0.0
    if centred:
        stacked = less_constants(stacked, weights)
    white = stacked * np.sqrt(weights)[..., None]
    flat = white.reshape(-1, white.shape[2])
    return np.asarray(flat.T @ flat), float((weights > 0).sum() - taken)


def less_constants(columns: FloatArray, weights: FloatArray) -> FloatArray:
    """Return columns (g, p, k) less each patch's mean over the groups, by weights (g, p)."""
    total = np.maximum(weights.sum(axis=0), 1e-300)
    return np.asarray(columns - np.einsum("gp,gpk->pk", weights, columns) / total[:, None])


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of a linear fit.

    Attributes:
        change: most probable factors of the columns (k,).
        covariance: of the factors (k, k).
        misfit: that is left.
    """

    change: FloatArray
    covariance: FloatArray
    misfit: float


def _parts(blocks: Sequence[Block], columns: Sequence[int]) -> tuple[float, FloatArray, FloatArray]:
    total = np.sum([block.gram for block in blocks], axis=0)
    index = np.asarray(columns, dtype=int) + 1
    return float(total[0, 0]), total[index, 0], total[np.ix_(index, index)]


def fit(
    blocks: Sequence[Block],
    columns: Sequence[int],
    precision: FloatArray,
    offset: FloatArray | None = None,
) -> Fit:
    """Fit columns by least squares with Gaussian priors.

    Args:
        blocks: of data.
        columns: indices of those to use.
        precision: of their priors (k, k).
        offset: prior mean of the change (k,); zero without it.
    """
    square, right, matrix = _parts(blocks, columns)
    mean = np.zeros(len(right)) if offset is None else offset
    covariance = np.linalg.inv(matrix + precision)
    change = covariance @ (precision @ mean - right)
    misfit = square + 2 * right @ change + change @ matrix @ change
    return Fit(np.asarray(change, dtype=float), np.asarray(covariance, dtype=float), float(misfit))


def within_reach(
    blocks: Sequence[Block],
    columns: Sequence[int],
    precision: FloatArray,
    own: Sequence[int],
    scales: FloatArray,
    reach: float,
) -> FloatArray:
    """Return the least squares change (k,), some of whose entries are limited (Levenberg 1944,
    Marquardt 1963).

    Damping holds back first what the data hardly determine. A whole step made shorter would keep
    its direction, which the undetermined entries rule.

    Args:
        blocks: of data.
        columns: as for `fit`.
        precision: as for `fit`.
        own: places among the columns of those with a limit.
        scales: of these (len(own),).
        reach: largest change of these, in their scales.
    """
    change = fit(blocks, columns, precision).change
    if not len(own) or np.abs(change[own] / scales).max() <= reach:
        return change
    index, damped = np.asarray(own), precision.copy()
    for damping in CRITERIA.fits.dampings:
        damped[index, index] = precision[index, index] + damping * scales**-2.0
        change = fit(blocks, columns, damped).change
        if np.abs(change[index] / scales).max() <= reach:
            break
    return change


def log_evidence(blocks: Sequence[Block], columns: Sequence[int], precision: FloatArray) -> float:
    """Return the log density of the residuals with the columns' factors integrated out [nats].

    A constant of the data is left out. Arguments as for `fit`.
    """
    square, right, matrix = _parts(blocks, columns)
    full = matrix + precision
    explained = right @ np.linalg.solve(full, right)
    occam = np.linalg.slogdet(full)[1] - np.linalg.slogdet(precision)[1]
    return float(-0.5 * (square - explained) - 0.5 * occam)


def explained(blocks: Sequence[Block], columns: Sequence[int], precision: FloatArray) -> float:
    """Return half the misfit that columns with these priors explain: their gain in log density
    [nats].

    Arguments as for `fit`.
    """
    _, right, matrix = _parts(blocks, columns)
    return 0.5 * float(right @ np.linalg.solve(matrix + precision, right))


def draw_rights(
    blocks: Sequence[Block],
    columns: Sequence[int],
    precision: FloatArray,
    draws: int,
    random: np.random.Generator,
) -> FloatArray:
    """Draw right sides (d, b, k) from the noise model.

    Each block has white noise and discrepancy of its own. The factors of `columns` are shared.

    Args:
        blocks: of data.
        columns: nuisances.
        precision: of their prior.
        draws: number of draws.
        random: generator.
    """
    shift = random.multivariate_normal(np.zeros(len(columns)), np.linalg.inv(precision), size=draws)
    rights = np.empty((draws, len(blocks), blocks[0].gram.shape[0] - 1))
    for number, block in enumerate(blocks):
        inner = block.gram[1:, 1:]
        values, vectors = np.linalg.eigh(inner)
        root = vectors * np.sqrt(np.maximum(values, 0))
        rights[:, number] = (
            random.standard_normal((draws, len(values))) @ root.T
            + shift @ inner[:, list(columns)].T
        )
    return rights


def predictive_score(
    blocks: Sequence[Block], columns: Sequence[int], precision: FloatArray, stated: int
) -> FloatArray:
    """Return the log predictive density (b + 1,) of each block given all others [nats].

    The last entry is that of the stated accuracies given the blocks. Touches, calliper and data
    sheet are measurements like any other and are left out in their turn, so that a model that
    explains the data only by breaking them has a low score.

    Args:
        blocks: of data.
        columns: as for `fit`.
        precision: as for `fit`.
        stated: number of nuisances, which come first.
    """
    whole = log_evidence(blocks, columns, precision)
    scores = [
        whole - log_evidence([*blocks[:i], *blocks[i + 1 :]], columns, precision)
        for i in range(len(blocks))
    ]
    free = precision.copy()
    free[:stated, :stated] *= CRITERIA.priors.flat_factor
    return np.array([*scores, whole - log_evidence(blocks, columns, free)])


def predictive_gain(score: FloatArray, baseline: FloatArray) -> tuple[float, float]:
    """Return the total gain [nats], and its standard error from paired differences."""
    difference = score - baseline
    return float(difference.sum()), float(difference.std(ddof=1) * np.sqrt(len(difference)))
