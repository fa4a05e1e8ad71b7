"""The test of the diagnosis's grid, by the difference between replays on two grids.

A diagnosis replays the stated setup on two grids of its own, whose difference is a nuisance of
every model. Data that need a large multiple of it show that both are too coarse. A setup that
states an even grid of its own is replayed on that grid. The grid of the diagnosis is then one more
model, which names the stated grid as a cause where it explains the data better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.noise.noise_model import Noise, rows_of

__all__ = ["too_coarse", "under_stated", "with_columns"]


def too_coarse(screened: float, bound: float) -> str:
    """Return the warning that the data need a finer grid than the diagnosis has, or no text.

    Args:
        screened: linear gain of the mesh error [nats].
        bound: gain from which a cause is named [nats].
    """
    if screened <= bound:
        return ""
    return (
        "the data ask for a finer grid than the diagnosis replays on: more of the difference "
        f"between its two grids gains {screened:.0f} nats, {bound:.0f} are chance; what is named "
        "may owe some of its gain to the grid"
    )


def with_columns(
    replayed: Sequence[Prediction], stated: Sequence[Prediction]
) -> tuple[Prediction, ...]:
    """Return replays on another grid with the columns of those on the stated one."""
    return tuple(
        here.replace_columns(rows_of(there)[1])
        for here, there in zip(replayed, stated, strict=True)
    )


def under_stated(noises: Sequence[Noise], stated: Sequence[Prediction]) -> list[Noise]:
    """Return the noise of the diagnosis's own grids for a stated model on another grid.

    Its residual is the one that counts where a model has no value.
    """
    found = []
    for noise, item in zip(noises, stated, strict=True):
        gap = rows_of(item)[0]
        seen = np.isfinite(gap)
        seen[list(item.failed)] = False
        found.append(
            replace(
                noise, weights=np.where(seen, noise.weights, 0.0), residual=np.where(seen, gap, 0.0)
            )
        )
    return found
