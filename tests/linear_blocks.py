"""Blocks of a linear problem made by hand: white noise of size one, nuisances as large as they are
stated to be, and causes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from palpate.diagnosis.inference.evidence import Block, gram
from palpate.foundation.arrays import FloatArray

__all__ = ["linear_blocks"]


def linear_blocks(
    columns: Sequence[FloatArray],
    nuisance: Sequence[int],
    precision: FloatArray,
    causes: Mapping[int, float],
    seed: int,
) -> list[Block]:
    """One block for each sequence's columns (g, p, k); `causes` are the true factors of columns
    that are no nuisance.
    """
    random = np.random.default_rng(seed)
    factors = np.zeros(columns[0].shape[2])
    factors[list(nuisance)] = random.multivariate_normal(
        np.zeros(len(nuisance)), np.linalg.inv(precision)
    )
    for column, factor in causes.items():
        factors[column] = factor
    weights = np.ones(columns[0].shape[:2])
    return [
        Block(
            str(number), *gram(random.standard_normal(weights.shape) - one @ factors, one, weights)
        )
        for number, one in enumerate(columns)
    ]
