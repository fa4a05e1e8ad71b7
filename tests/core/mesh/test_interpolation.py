from __future__ import annotations

from itertools import pairwise

import numpy as np

from palpate.measurement.patch_averages import patch_medians
from palpate.mesh.interpolation import neighbourhood_means, patch_rows, weighted_nodes

RANDOM = np.random.default_rng(3)
NODES, WEIGHTS, NORMALS = (
    RANDOM.integers(0, 40, (300, 8)),
    RANDOM.uniform(size=(300, 8)),
    RANDOM.normal(size=(300, 3)),
)


def test_weighted_nodes_are_weighted_sums():
    field = RANDOM.normal(size=(40, 2))
    assert np.allclose(
        weighted_nodes(NODES, WEIGHTS, field),
        np.einsum("ma,mac->mc", WEIGHTS, field[NODES]),
        rtol=1e-13,
    )
    assert weighted_nodes(NODES[:0], WEIGHTS[:0], field).shape == (0, 2)


def test_patch_rows_sum_over_each_patchs_points_also_for_empty_patches():
    ends = np.array([0, 100, 100, 101, 300])
    entries, columns, rows = patch_rows(NODES, WEIGHTS, NORMALS, ends, 40)
    moved = RANDOM.normal(size=(40, 3))
    along = np.einsum("mi,ma,mai->m", NORMALS, WEIGHTS, moved[NODES])
    expected = [along[begin:end].sum() for begin, end in pairwise(ends)]
    found = [entries[a:b] @ moved.ravel()[columns[a:b]] for a, b in pairwise(rows)]
    assert np.allclose(found, expected, rtol=1e-12)
    for a, b in pairwise(rows):
        assert len(np.unique(columns[a:b])) == b - a


def test_medians_by_patch_equal_numpys_and_are_nan_for_empty_patches():
    patch, values = RANDOM.integers(0, 30, 400), RANDOM.normal(size=400)
    patch[patch == 7] = 8
    patch[:2], patch[patch == 5] = 5, 6
    expected = [
        np.median(values[patch == number]) if (patch == number).any() else np.nan
        for number in range(31)
    ]
    assert np.array_equal(patch_medians(values, patch, 31), expected, equal_nan=True)


def test_neighbourhood_means_are_those_of_the_points_within_reach():
    rng = np.random.default_rng(4)
    points, values, places = (
        rng.uniform(-1, 1, (400, 3)),
        rng.normal(size=400),
        rng.uniform(-1.5, 1.5, (60, 3)),
    )
    near = np.linalg.norm(places[:, None] - points, axis=2) < 0.4
    found = neighbourhood_means(places, points, values, 0.4, 3)
    enough = near.sum(axis=1) >= 3
    assert 5 < enough.sum() < 55
    assert np.array_equal(np.isfinite(found), enough)
    assert np.allclose(found[enough], [values[row].mean() for row in near[enough]])
    assert np.isnan(neighbourhood_means(places, points[:0], values[:0], 0.4, 3)).all()
    flat = np.column_stack([points[:, :2], np.full(400, 0.7)])
    assert np.allclose(neighbourhood_means(flat[:5], flat, values, 5.0, 3), values.mean())
