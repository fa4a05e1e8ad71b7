"""The one colour of each thing, and the map of signed errors; the page and the scene both read them from here."""

from __future__ import annotations

from typing import Any

import numpy as np

from core.frames import FloatArray

__all__ = ["BANDS", "EXTENDED", "MEASURED", "RAW", "SIGNED", "TOOL", "UNSEEN", "band_of", "nice_limit", "palette"]

Rgb = tuple[int, int, int]
IntArray = np.ndarray[Any, np.dtype[np.int64]]

MEASURED: Rgb = (224, 152, 32)
RAW: Rgb = (100, 116, 139)
EXTENDED: Rgb = (13, 148, 136)
CORRECTED: Rgb = (124, 92, 220)
TOOL: Rgb = (84, 88, 96)
FLOOR: Rgb = (203, 208, 215)
UNSEEN: Rgb = (172, 176, 182)

# Fabio Crameri's "vik" (Scientific colour maps 8, doi:10.5281/zenodo.1243862, MIT licence) at the centres of 15 equal bands:
# perceptually uniform, readable with every kind of colour blindness, the middle band neutral.
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


def band_of(error: FloatArray, limit: float) -> IntArray:
    """The band 0..BANDS-1 of each signed error [m] for a scale of -limit..limit [m]; BANDS where the error is NaN (unseen)."""
    scaled = np.floor((error / limit + 1.0) * (BANDS / 2.0))
    bands = np.clip(np.nan_to_num(scaled, nan=0.0), 0, BANDS - 1).astype(np.int64)
    return np.where(np.isnan(error), BANDS, bands)


def nice_limit(errors: FloatArray) -> float:
    """A round scale end [m] that holds 95 % of the absolute errors [m], at least 0.1 mm."""
    seen = np.abs(errors[np.isfinite(errors)])
    if seen.size == 0:
        return 1e-3
    wanted = max(float(np.quantile(seen, 0.95)), 1e-4)
    decade = 10.0 ** np.floor(np.log10(wanted))
    steps = np.array([1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0])
    return float(round(decade * steps[np.searchsorted(steps, wanted / decade - 1e-9)], 9))


def palette() -> dict[str, Any]:
    """All colours as the page reads them."""
    names = {"measured": MEASURED, "raw": RAW, "extended": EXTENDED, "corrected": CORRECTED, "tool": TOOL, "floor": FLOOR}
    return {"things": {**names, "unseen": UNSEEN}, "signed": SIGNED}
