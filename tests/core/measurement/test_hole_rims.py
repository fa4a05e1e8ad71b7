"""Readings at the rim of holes, on made-up depth images of a tilted plane."""

from __future__ import annotations

import numpy as np

from palpate.measurement.hole_rims import FULL, WIDTH, beside_holes

ROWS, COLUMNS, PITCH = 60, 80, 2.5e-3


def sights(known: np.ndarray) -> np.ndarray:
    """Unit vectors to the known pixels of an image (r, c)."""
    row, column = np.nonzero(known)
    flat = np.column_stack([column - COLUMNS / 2, row - ROWS / 2]) * PITCH
    rays = np.column_stack([flat, np.ones(len(flat))])
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True))


def image(rims: np.ndarray, known: np.ndarray) -> np.ndarray:
    """Image (r, c) of a mask of the known pixels."""
    whole = np.zeros(known.shape, dtype=bool)
    whole[known] = rims
    return whole


def test_rim_of_a_hole_is_found_and_the_readings_further_away_are_kept() -> None:
    row, column = np.mgrid[:ROWS, :COLUMNS]
    away = np.hypot(row - 30, column - 40)
    known = away > 9
    rims = image(beside_holes(sights(known), np.ones(known.sum(), dtype=bool)), known)
    inner = (away > 9) & (away < 10)
    further = (away > 12) & (row > 3) & (row < 56) & (column > 3) & (column < 76)
    assert rims[inner].mean() > 0.9 and not rims[further].any()


def test_holes_of_single_pixels_make_no_rims() -> None:
    known = np.random.default_rng(1).random((ROWS, COLUMNS)) > 0.05
    inside = np.zeros_like(known)
    inside[4:-4, 4:-4] = True
    rims = image(beside_holes(sights(known), np.ones(known.sum(), dtype=bool)), known)
    assert rims[inside].mean() < 0.01


def test_readings_that_are_not_asked_for_are_neighbours_and_never_at_a_rim() -> None:
    known = np.ones((ROWS, COLUMNS), dtype=bool)
    asked = np.zeros_like(known)
    asked[20:40, 20:60] = True
    assert not beside_holes(sights(known), asked.ravel()).any()


def test_cloud_of_few_readings_is_kept() -> None:
    known = np.zeros((ROWS, COLUMNS), dtype=bool)
    known[::10, ::10] = True
    assert not beside_holes(sights(known), np.ones(known.sum(), dtype=bool)).any()


def test_readings_are_counted_as_by_their_distances() -> None:
    known = np.random.default_rng(2).random((ROWS, COLUMNS)) > 0.2
    rays = np.concatenate([sights(known), [[1.0, 0.0, 0.0]]])  # and a stray one far aside
    between = np.linalg.norm(rays[:, None] - rays, axis=2)
    spacing = np.median(np.sort(between, axis=1)[:: len(rays) // 500 + 1, 1])
    count = (between <= WIDTH * spacing).sum(axis=1)
    rim = beside_holes(rays, np.ones(len(rays), dtype=bool))
    assert np.array_equal(rim, count < FULL * np.median(count)) and 0 < rim.sum() < len(rim)
