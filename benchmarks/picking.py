"""Accuracy and time of picking points by clicks on a noisy slanted cloud."""

from __future__ import annotations

from time import perf_counter

import numpy as np
from rich.table import Table

from palpate.foundation.arrays import FloatArray
from palpate.registration.picking import pick_cloud

__all__ = ["aimed_and_picked", "run"]

POINTS, HEIGHT, WIDTH, FIELD_OF_VIEW = 45_000, 700, 1000, 0.6
RANGE, NOISE, SLANT = 0.25, 5.0e-4, np.radians(55.0)
"""Distance to the eye [m], white noise along the line of sight [m], slant of the surface [rad]."""
MOST = 3.0e-4
"""Largest median distance of picked and aimed point [m]."""


def aimed_and_picked(clicks: int, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    """Return aimed and picked points (clicks, 3) [m], eye frame.

    Clicks are at integer pixels; rays pass through the centres of pixels.
    """
    rng = np.random.default_rng(seed)
    cloud = _cloud(rng)
    focal = HEIGHT / 2 / np.tan(FIELD_OF_VIEW / 2)
    centre = np.array([WIDTH, HEIGHT]) / 2
    aimed = cloud[rng.choice(np.flatnonzero(np.abs(cloud[:, 1]) < 0.03), clicks)]
    pixels = np.floor(aimed[:, :2] / aimed[:, 2:] * focal + centre)
    rays = np.column_stack([(pixels + 0.5 - centre) / focal, np.ones(clicks)])
    picked = np.full((clicks, 3), np.nan)
    for row, ray in enumerate(rays):
        index = pick_cloud(cloud, np.zeros(3), ray, 1 / focal)
        if index is not None:
            picked[row] = cloud[index]
    return aimed, picked


def _cloud(rng: np.random.Generator) -> FloatArray:
    """Return a slanted plane of 100 x 100 mm, seen from the origin along z."""
    x, y = rng.uniform(-0.05, 0.05, (2, POINTS))
    surface = np.column_stack([x, y * np.cos(SLANT), RANGE + y * np.sin(SLANT)])
    reach = np.linalg.norm(surface, axis=1, keepdims=True)
    return np.asarray(surface * (1.0 + rng.normal(0.0, NOISE, (POINTS, 1)) / reach))


def run() -> list[Table]:
    """Measure 1000 clicks; RuntimeError where the median distance is 0.3 mm or more."""
    start = perf_counter()
    aimed, picked = aimed_and_picked(1000)
    spent = (perf_counter() - start) / 1000
    apart = np.linalg.norm(aimed - picked, axis=1)
    middle, most = float(np.nanmedian(apart)), float(np.nanquantile(apart, 0.95))
    table = Table(
        "points",
        "noise, mm",
        "slant, degrees",
        "median, mm",
        "95 %, mm",
        "missed",
        "ms per click",
        title="picking",
    )
    missed = int(np.isnan(apart).sum())
    numbers = (f"{middle * 1e3:.2f}", f"{most * 1e3:.2f}", str(missed), f"{spent * 1e3:.1f}")
    table.add_row(f"{POINTS}", f"{NOISE * 1e3:.1f}", f"{np.degrees(SLANT):.0f}", *numbers)
    if not middle < MOST:
        raise RuntimeError(
            f"the median distance of picked and aimed point is {middle * 1e3:.2f} mm; "
            f"expected less than {MOST * 1e3:.1f} mm"
        )
    return [table]
