"""Whether the grid is too coarse for the data: the pattern that tells a replay from the same one on
a finer grid.

A diagnosis replays the stated setup on two grids of its own, whose difference is a nuisance of
every model. Data that ask for much more of it than that say that both are too coarse. A setup that
states an even grid of its own is replayed on that, and the diagnosis's grid is then one more model,
which names the stated one where it explains what was measured better.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from palpate.diagnosis.forward.prediction import Prediction
from palpate.diagnosis.inference.noise_model import Noise, rows_of
from palpate.effects.geometry import MeshResolution

__all__ = ["OWN_GRID", "too_coarse", "under_stated", "with_columns"]

OWN_GRID = MeshResolution(element_size=MeshResolution.numbers()[0].low)
"""A grid so fine is no grid of the setup's any more."""


def too_coarse(screened: float, bound: float) -> str:
    """What a report says where the data ask for a finer grid than the diagnosis has; empty where
    they do not.

    Args:
        screened: gain of `mesh_candidate` [nats].
        bound: gain from which a cause is named [nats].
    """
    if screened <= bound:
        return ""
    return (
        f"the data ask for a finer grid than the diagnosis replays on: more of the difference between its two grids gains "
        f"{screened:.0f} nats, {bound:.0f} are chance; what is named may owe some of its gain to the grid"
    )


def with_columns(
    replayed: Sequence[Prediction], stated: Sequence[Prediction]
) -> tuple[Prediction, ...]:
    """Replays on another grid with the columns of those on the stated one."""
    return tuple(
        here.replace_columns(rows_of(there)[1])
        for here, there in zip(replayed, stated, strict=True)
    )


def under_stated(noises: Sequence[Noise], stated: Sequence[Prediction]) -> list[Noise]:
    """The noise as measured on the diagnosis's own grids, for a stated model on another: what is
    lost falls back on it.
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
