from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, SETUP, poke, prediction
from scipy.linalg import null_space

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.noise.noise_model import Noise, noises, patch_variance
from palpate.foundation.arrays import FloatArray
from palpate.replay.replay import replay

GROUPS, PATCHES, COLUMNS, FIELDS = 4, 6, 2, 3


def _measured(counts: FloatArray, sigma: FloatArray, seed: int) -> tuple[FloatArray, FloatArray]:
    """Means and standard deviations (g, p) [m] of normal samples of these sizes (g, p)."""
    random = np.random.default_rng(seed)
    drawn = [
        [random.normal(0, s, int(n)) for n, s in zip(row, sigma, strict=True)] for row in counts
    ]
    mean = [[values.mean() for values in row] for row in drawn]
    return np.array(mean), np.array(
        [[values.std(ddof=1) if len(values) > 1 else 0.0 for values in row] for row in drawn]
    )


def _noise(seed: int = 0, fields: int = FIELDS) -> Noise:
    random = np.random.default_rng(seed)
    weights = random.uniform(0.5, 2.0, (GROUPS, PATCHES))
    weights[1, 3] = weights[2, 0] = 0.0
    residual = np.where(weights > 0, random.standard_normal(weights.shape), 0.0)
    mesh = 0.3 * random.standard_normal(weights.shape)
    return Noise(
        weights,
        residual,
        np.where(weights > 0, mesh, 0.0),
        random.standard_normal((GROUPS, PATCHES, fields)),
    )


def _model(seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Gap (g, p) and columns (g, p, k) of a model."""
    random = np.random.default_rng(seed)
    return random.standard_normal((GROUPS, PATCHES)), random.standard_normal(
        (GROUPS, PATCHES, COLUMNS)
    )


def test_variance_of_points_is_pooled_over_groups_patch_by_patch():
    sigma = np.array([1e-4, 5e-4, 2e-3])
    counts = np.tile([40.0, 200.0, 80.0], (30, 1))
    mean, spread = _measured(counts, sigma, 1)
    found = patch_variance(
        [
            prediction(mean[:15], count=counts[:15], spread=spread[:15]),
            prediction(mean[15:], count=counts[15:], spread=spread[15:]),
        ]
    )
    assert np.allclose(np.sqrt(found), sigma, rtol=0.06)


def test_patch_with_few_points_gets_the_median_of_the_others():
    sigma = np.array([1e-4, 5e-4, 2e-3, 1e-2])
    counts = np.tile([40.0, 40.0, 40.0, 2.0], (30, 1))
    mean, spread = _measured(counts, sigma, 2)
    mean[:, 3] = np.nan
    found = patch_variance([prediction(mean, count=counts, spread=spread)])
    assert found[3] == np.median(found[:3])


def test_block_is_that_of_the_dense_covariance_of_white_noise_and_discrepancy():
    noise, (gap, columns) = _noise(), _model()
    found = noise.block(prediction(gap, columns=columns))
    seen = noise.weights.ravel() > 0
    constants = np.tile(np.eye(PATCHES), (GROUPS, 1))[seen]
    across = null_space(constants.T)
    fields = noise.discrepancy.reshape(-1, FIELDS)[seen]
    covariance = across.T @ (np.diag(1 / noise.weights.ravel()[seen]) + fields @ fields.T) @ across
    parts = [
        (gap + noise.mesh).reshape(-1, 1),
        columns.reshape(-1, COLUMNS),
        noise.mesh.reshape(-1, 1),
    ]
    stacked = across.T @ np.concatenate(parts, axis=1)[seen]
    assert np.allclose(found.gram, stacked.T @ np.linalg.solve(covariance, stacked))
    assert found.values == seen.sum() - PATCHES


def test_column_that_the_engine_may_be_wrong_about_says_little():
    noise, (gap, columns) = _noise(), _model()
    wrong = replace(
        noise, discrepancy=np.concatenate([noise.discrepancy, 1e3 * columns[..., :1]], axis=2)
    )
    before, after = (item.block(prediction(gap, columns=columns)).gram for item in (noise, wrong))
    assert after[1, 1] < 1e-5 * before[1, 1]
    assert after[2, 2] > 0.3 * before[2, 2]


def test_patch_that_a_model_loses_sight_of_stays_at_the_baseline():
    noise, (gap, columns) = _noise(), _model()
    lost, neutral, zeroed = gap.copy(), gap.copy(), columns.copy()
    lost[0, 2], neutral[0, 2], zeroed[0, 2] = np.nan, noise.residual[0, 2], 0.0
    found, wanted = (
        noise.block(prediction(lost, columns=columns)),
        noise.block(prediction(neutral, columns=zeroed)),
    )
    assert np.allclose(found.gram, wanted.gram)
    assert found.values == wanted.values


def test_patch_that_the_baseline_does_not_see_is_not_read():
    noise, (gap, columns) = _noise(), _model()
    other = np.where(noise.weights > 0, gap, 100.0)
    assert np.allclose(
        noise.block(prediction(other, columns=columns)).gram,
        noise.block(prediction(gap, columns=columns)).gram,
    )


def test_model_without_any_equilibrium_neither_gains_nor_loses():
    noise, (gap, columns) = _noise(), _model()
    found = noise.block(prediction(gap, columns=columns, failed=tuple(range(GROUPS)))).gram
    baseline = noise.block(prediction(noise.residual, columns=columns)).gram
    assert found[0, 0] == pytest.approx(baseline[0, 0])
    assert not found[1:-1, :].any()


def test_noise_states_the_engines_accuracy_at_every_touched_patch():
    surface = SETUP.surface()
    centres = np.array([poke(-6e-3), poke(3e-3)])
    frames = tuple(replay(SETUP, centres, GRID))
    random = np.random.default_rng(3)
    gap, columns = (
        1e-4 * random.standard_normal((2, surface.patches)),
        random.standard_normal((2, surface.patches, 5)),
    )
    finer = gap + 2e-4
    gap[1, 7] = finer[1, 9] = np.nan
    baseline = replace(prediction(gap, columns=columns), equilibria=frames)
    noise = noises(
        [baseline], [replace(prediction(finer), equilibria=frames)], surface, slice(3, 5)
    )[0]
    moved = np.linalg.norm(frames[1].move(surface.patch_centres) - surface.patch_centres, axis=1)
    displacement, stiffness = noise.discrepancy[..., :-2], noise.discrepancy[..., -2:]
    assert np.allclose(
        np.linalg.norm(displacement[1], axis=1), CRITERIA.noise.displacement_error * moved
    )
    assert not displacement[0].any()
    assert np.allclose(stiffness, CRITERIA.noise.stiffness_error * columns[..., 3:])
    assert (noise.weights[1, [7, 9]] == 0).all() and (noise.residual[1, [7, 9]] == 0).all()
    assert noise.weights[0, 0] < (0.5 * 2e-4) ** -2  # half the meshes' difference counts as scatter
    assert np.allclose(noise.mesh[0], 2e-4)


def test_group_without_equilibrium_in_the_baseline_has_no_weight():
    surface = SETUP.surface()
    gap, columns = np.full((3, surface.patches), 1e-4), np.zeros((3, surface.patches, 1))
    whole = prediction(gap, columns=columns)
    fine = prediction(gap, failed=(2,))
    noise = Noise.of(
        prediction(gap, columns=columns, failed=(0,)),
        fine,
        surface,
        np.full(surface.patches, 1e-7),
        slice(0, 1),
    )
    assert not noise.weights[[0, 2]].any() and noise.weights[1].all()
    assert np.isfinite(noise.block(whole).gram).all()


def test_mesh_error_of_another_model_keeps_the_weights():
    noise, (gap, columns) = _noise(), _model()
    other = noise.remeshed(prediction(gap, columns=columns), prediction(gap + 0.7))
    seen = noise.weights > 0
    assert np.allclose(other.mesh[seen], 0.7)
    assert np.array_equal(other.mesh[~seen], noise.mesh[~seen])
    assert np.array_equal(other.weights, noise.weights)


def test_patch_of_which_a_settled_model_shows_another_side_loses_its_weight():
    gap = np.full((3, 4), 0.1e-3)
    noise = Noise(np.ones((3, 4)), gap, np.zeros((3, 4)), np.zeros((3, 4, 1)))
    turned = np.zeros((3, 4))
    turned[1, 2], turned[2, 3] = 0.9, 0.1
    here = replace(prediction(gap), other_side=turned)
    settled = noise.remeshed(here, here)
    assert settled.weights[1, 2] == 0.0 and settled.weights.sum() == 11.0
    assert noise.weights.all()
