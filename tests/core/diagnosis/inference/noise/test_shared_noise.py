"""Noise that the points of a patch share within a cloud, on made-up points."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from palpate.diagnosis.forward.prediction import PointSample, Prediction
from palpate.diagnosis.inference.noise.noise_model import scatter_share
from palpate.diagnosis.inference.noise.shared_noise import clouds_in_patches, shared_noise

PATCHES, CLOUDS, POINTS = 80, 12, 8


def sample(shared: float, drift: float = 0.0, seed: int = 0) -> PointSample:
    """Points of noise 1 mm, of which a patch's share a part in each cloud.

    Args:
        shared: standard deviation of that part [mm].
        drift: motion of all points from one cloud to the next [mm].
        seed: of the noise.
    """
    rng = np.random.default_rng(seed)
    cloud, patch, _ = np.indices((CLOUDS, PATCHES, POINTS)).reshape(3, -1)
    gap = rng.normal(size=len(cloud)) + drift * cloud
    gap += shared * rng.normal(size=(CLOUDS, PATCHES))[cloud, patch]
    whole = np.arange(len(cloud), dtype=np.int32)
    nothing = np.zeros((len(cloud), 3))
    return PointSample(
        whole,
        patch.astype(np.int32),
        1e-3 * gap,
        np.ones(len(cloud)),
        nothing,
        np.zeros(len(cloud), np.int8),
        cloud.astype(np.int16),
    )


def prediction(*samples: PointSample, touched: bool = False) -> Prediction:
    frames: Any = tuple(SimpleNamespace(in_contact=touched) for _ in samples)
    gap = np.zeros((len(samples), PATCHES))
    count = np.full(gap.shape, CLOUDS * POINTS)
    return Prediction("poke", gap, count, gap, np.zeros((*gap.shape, 0)), frames, samples)


def test_independent_noise_is_not_shared() -> None:
    found = [shared_noise([prediction(sample(0.0, seed=seed))]) for seed in range(20)]
    assert found == [0.0] * 20


@pytest.mark.parametrize("size", [0.3, 0.6, 1.2])
def test_size_of_shared_noise_is_found(size: float) -> None:
    found = shared_noise([prediction(*(sample(size, seed=seed) for seed in range(3)))])
    assert found == pytest.approx(size**2, rel=0.15)


def test_slow_motion_is_no_noise() -> None:
    assert shared_noise([prediction(sample(0.0, drift=0.05))]) == 0.0


def test_clouds_with_contact_and_without_numbers_tell_nothing() -> None:
    assert shared_noise([prediction(sample(1.0), touched=True)]) == 0.0
    numbered = sample(1.0)
    unknown = PointSample(
        *(getattr(numbered, name) for name in ("index", "patch", "gap", "facing", "foot", "side"))
    )
    assert shared_noise([prediction(unknown)]) == 0.0


def test_averages_have_the_variance_that_is_stated() -> None:
    size = 0.6
    means = np.array(
        [
            np.bincount(one.patch, one.gap, minlength=PATCHES) / (CLOUDS * POINTS)
            for one in (sample(size, seed=seed) for seed in range(40))
        ]
    )
    one = prediction(sample(size))
    assert np.all(clouds_in_patches(one) == CLOUDS)
    stated = 1e-6 * scatter_share(one, size**2).mean()
    assert means.var() == pytest.approx(stated, rel=0.1)
    assert means.var() > 2 * 1e-6 * scatter_share(one, 0.0).mean()
