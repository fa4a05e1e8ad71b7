"""Colours of all things, and the colour maps; the page reads them from here."""

from __future__ import annotations

from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = [
    "BANDS",
    "EXTENDED",
    "LANDMARK",
    "MEASURED",
    "RAW",
    "SEQUENTIAL",
    "SIGNED",
    "TOOL",
    "UNSEEN",
    "band_of",
    "nice_end",
    "nice_limit",
    "palette",
    "step_of",
]

Rgb = tuple[int, int, int]
IntArray = np.ndarray[Any, np.dtype[np.int64]]

MEASURED: Rgb = (224, 152, 32)
RAW: Rgb = (100, 116, 139)
EXTENDED: Rgb = (13, 148, 136)
CORRECTED: Rgb = (124, 92, 220)
TOOL: Rgb = (84, 88, 96)
FLOOR: Rgb = (203, 208, 215)
UNSEEN: Rgb = (172, 176, 182)
LANDMARK: Rgb = (37, 99, 235)
SUPPORT: Rgb = (128, 135, 146)

# Fabio Crameri's "vik" (Scientific colour maps 8, doi:10.5281/zenodo.1243862, MIT licence) at the
# centres of 15 equal bands: perceptually uniform, readable with every kind of colour blindness, the
# middle band neutral.
SIGNED: tuple[Rgb, ...] = (
    (2, 32, 105),
    (2, 58, 122),
    (6, 85, 140),
    (36, 116, 160),
    (86, 151, 184),
    (140, 185, 207),
    (193, 217, 228),
    (236, 229, 225),
    (232, 201, 182),
    (218, 167, 138),
    (205, 136, 96),
    (192, 106, 57),
    (170, 70, 19),
    (134, 35, 6),
    (103, 11, 7),
)
BANDS = len(SIGNED)

# "viridis" of matplotlib at the centres of 12 equal steps: perceptually uniform and colour-blind
# safe, for quantities without sign.
SEQUENTIAL: tuple[Rgb, ...] = (
    (71, 16, 99),
    (71, 45, 123),
    (64, 70, 136),
    (54, 93, 141),
    (44, 114, 142),
    (36, 134, 142),
    (31, 154, 138),
    (40, 174, 128),
    (72, 193, 110),
    (117, 208, 84),
    (173, 220, 48),
    (229, 228, 25),
)


def band_of(error: FloatArray, limit: float) -> IntArray:
    """Band 0..BANDS-1 of each signed error [m] on a scale of -limit..limit [m]; BANDS for NaN
    (unseen).
    """
    scaled = np.floor((error / limit + 1.0) * (BANDS / 2.0))
    bands = np.clip(np.nan_to_num(scaled, nan=0.0), 0, BANDS - 1).astype(np.int64)
    return np.where(np.isnan(error), BANDS, bands)


def step_of(values: FloatArray, limit: float) -> IntArray:
    """Step 0..len(SEQUENTIAL)-1 of each value on a scale of 0..limit; len(SEQUENTIAL) for NaN."""
    steps = np.clip(
        np.floor(np.nan_to_num(values, nan=0.0) / limit * len(SEQUENTIAL)), 0, len(SEQUENTIAL) - 1
    ).astype(np.int64)
    return np.where(np.isnan(values), len(SEQUENTIAL), steps)


def nice_limit(errors: FloatArray) -> float:
    """Round end of a scale [m] that contains 95 % of the absolute errors [m]; at least 0.1 mm."""
    return nice_end(errors, 0.95, 1e-4, 1e-3)


def nice_end(values: FloatArray, share: float, least: float, otherwise: float) -> float:
    """Round end of a scale.

    Args:
        values: to be shown.
        share: of the absolute values that the scale contains [1].
        least: smallest end.
        otherwise: end where all values are NaN.
    """
    seen = np.abs(values[np.isfinite(values)])
    if seen.size == 0:
        return otherwise
    least_end = max(float(np.quantile(seen, share)), least)
    decade = 10.0 ** np.floor(np.log10(least_end))
    steps = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])
    return float(round(decade * steps[np.searchsorted(steps, least_end / decade - 1e-9)], 9))


def palette() -> dict[str, Any]:
    """All colours as the page reads them."""
    names = {
        "measured": MEASURED,
        "raw": RAW,
        "extended": EXTENDED,
        "corrected": CORRECTED,
        "tool": TOOL,
        "floor": FLOOR,
    }
    return {
        "things": {**names, "unseen": UNSEEN, "landmark": LANDMARK},
        "signed": SIGNED,
        "sequential": SEQUENTIAL,
    }
