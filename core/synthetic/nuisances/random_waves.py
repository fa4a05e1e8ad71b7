"""Smooth random fields as sums of waves."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["WAVES", "sum_of_waves"]

WAVES = 24
"""Usual number of waves of a field."""


def sum_of_waves(
    places: FloatArray, waves: FloatArray, rng: np.random.Generator, parts: int | None = None
) -> FloatArray:
    """Draw phases and heights of waves and add them up; the RMS is about sqrt(k / 2).

    Args:
        places: (..., d) [m], or directions [1].
        waves: (k, d) wave vectors [rad/m], or [rad].
        rng: random generator.
        parts: number of components of the field; a scalar field if None.

    Returns:
        the field (...), or (..., parts) [1].
    """
    phases = rng.uniform(0, 2 * np.pi, len(waves))
    heights = rng.normal(size=len(waves) if parts is None else (len(waves), parts))
    return np.asarray(np.cos(places @ waves.T + phases) @ heights)
