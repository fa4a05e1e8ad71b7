"""A camera's smooth error is no finding, depth that waves with the distance is, and neither passes
for the other.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.diagnosis.inference.noise.camera_error_model import CameraErrors, camera_errors
from palpate.foundation.arrays import FloatArray

WHITE = 6e-5
RANDOM = 5


def _places() -> tuple[FloatArray, FloatArray]:
    """A table and a block on it (n, 3) [m], and how far they are from a camera that looks down at
    45 degrees [m].
    """
    random = np.random.default_rng(RANDOM)
    places = random.uniform(-0.06, 0.06, (300, 3)) * [1.0, 1.0, 0.0]
    places[:200] = places[:200] * [0.5, 0.3, 1.0] + [0.0, 0.0, 0.035]
    return places, 0.35 - (places[:, 0] + places[:, 2]) / np.sqrt(2)


def _errors(bias: float, waves: float, period: float = 0.018, seed: int = RANDOM) -> CameraErrors:
    """Of a camera with this root mean square of its smooth error, and of its waves [m]."""
    random = np.random.default_rng(seed)
    places, depth = _places()
    distance = np.linalg.norm(places[:, None] - places, axis=2)
    kernel = np.exp(-0.5 * (distance / 0.02) ** 2) + 1e-6 * np.eye(len(places))
    smooth = np.linalg.cholesky(kernel) @ random.standard_normal(len(places))
    waving = np.sqrt(2) * np.sin(2 * np.pi * depth / period)
    residual = bias * smooth + waves * waving + WHITE * random.standard_normal(len(places))
    return camera_errors(
        places,
        depth,
        np.full(len(places), WHITE**2),
        residual,
        np.column_stack([np.ones(len(places)), places]),
    )


def test_smooth_bias_is_measured_with_its_reach() -> None:
    errors = _errors(bias=3e-4, waves=0.0)
    assert 2e-4 <= errors.bias <= 4e-4
    assert 0.014 <= errors.reach <= 0.028


@pytest.mark.parametrize("bias", [0.0, 1.5e-4, 3e-4, 6e-4])
@pytest.mark.parametrize("seed", range(6))
def test_smooth_bias_is_no_ripple(bias: float, seed: int) -> None:
    errors = _errors(bias, waves=0.0, seed=seed)
    assert not errors.ripple.significant
    assert np.linalg.cond(errors.covariance) < 1e9


@pytest.mark.parametrize("period", [0.014, 0.024])
def test_waves_are_told_beside_a_smooth_bias_and_measured(period: float) -> None:
    errors = _errors(bias=3e-4, waves=2e-4, period=period)
    assert errors.ripple.significant
    assert 1e-4 <= errors.ripple.size <= 4e-4
    assert period / 9 < errors.ripple.reach < period / 3
    assert 2e-4 <= errors.bias <= 4e-4


def test_told_waves_are_part_of_the_covariance() -> None:
    places, depth = _places()
    apart = np.linalg.norm(places[:, None] - places, axis=2) > 0.08
    shared = apart & (np.abs(depth[:, None] - depth) < 5e-4)
    calm, waving = (
        float(_errors(bias=2e-4, waves=size).covariance[shared].mean()) for size in (0.0, 4e-4)
    )
    assert calm < 1e-8
    assert waving > 4e-8
