"""Nuisances of depth images, on made-up images of a plane."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.nuisances import DepthImage
from palpate.synthetic.nuisances.camera_timing import LostFrames, RollingShutter, WarmUp
from palpate.synthetic.nuisances.depth_noise import FlyingPixels, MultiPath, SmoothBias, StereoNoise
from palpate.synthetic.nuisances.driver_filters import (
    Decimation,
    HoleFilling,
    SpatialFilter,
    TemporalFilter,
)
from palpate.synthetic.nuisances.lost_pixels import DarkHoles, Gloss, MaskedTool
from palpate.synthetic.nuisances.phantom_form import Texture

PITCH = 3e-3
SHAPE = (60, 80)


def plane(depth: FloatArray | float, what: int = 0) -> DepthImage:
    """A block that faces the camera at this depth [m], or one with a depth for each pixel."""
    rows, columns = np.indices(SHAPE)
    rays = np.stack([(columns - 40) * PITCH, (rows - 30) * PITCH, np.ones(SHAPE)], axis=2)
    image = np.broadcast_to(np.asarray(depth, dtype=float), SHAPE).copy()
    facing = np.zeros((*SHAPE, 3)) - (0.0, 0.0, 1.0)
    return DepthImage(image, np.full(SHAPE, what), rays, facing, rays * image[..., None])


def seen(nuisance: object, image: DepthImage, seed: int = 1) -> FloatArray:
    """Depth [m] of the image with a nuisance."""
    rng = np.random.default_rng(seed)
    return nuisance.image(lambda instant: image, 0.0, rng).depth  # type: ignore[attr-defined, no-any-return]


def test_stereo_noise_grows_with_the_distance_squared() -> None:
    noise = StereoNoise(1e-3, 0.0, 0.0)
    near, far = (seen(noise, plane(depth)) - depth for depth in (0.35, 0.7))
    assert near.std() == pytest.approx(1e-3, rel=0.05)
    assert far.std() == pytest.approx(4e-3, rel=0.05)
    assert abs(near.mean()) < 1e-4


def test_stereo_noise_comes_in_steps_of_disparity() -> None:
    depth = seen(StereoNoise(1e-3, 0.4e-3, 0.0), plane(0.35))
    values = np.unique(depth.round(8))
    assert np.diff(values) == pytest.approx(0.4e-3, rel=0.05)


def test_slant_adds_noise() -> None:
    image = plane(0.35)
    tilted = image.normals.copy()
    tilted[...] = (np.sin(1.2), 0.0, -np.cos(1.2))
    slanted = DepthImage(image.depth, image.what, image.rays, tilted, image.material)
    noise = StereoNoise(1e-3, 0.0, 0.1)
    assert seen(noise, slanted).std() > 1.5 * seen(noise, image).std()


def test_smooth_bias_is_fixed_and_smooth() -> None:
    bias = SmoothBias(0.3e-3, 4)
    error = seen(bias, plane(0.35)) - 0.35
    assert np.array_equal(error, seen(bias, plane(0.35), seed=9) - 0.35)
    assert np.sqrt(np.mean(error**2)) == pytest.approx(0.3e-3, rel=0.5)
    assert np.abs(np.diff(error, axis=1)).max() < 0.1e-3


def test_multi_path_sinks_the_foot_of_the_block() -> None:
    image = plane(0.35)
    heights = np.broadcast_to(np.linspace(0, 0.03, SHAPE[0])[:, None], SHAPE)
    image.material[..., 2] = heights
    error = seen(MultiPath(1e-3, 3e-3), image) - 0.35
    assert error[0, 0] == pytest.approx(1e-3)
    assert error[-1, 0] < 1e-6


def test_flying_pixels_lie_between_the_surfaces_of_an_edge() -> None:
    step = np.where(np.arange(SHAPE[1]) < 40, 0.35, 0.37)
    depth = seen(FlyingPixels(0.5), plane(step[None]))
    moved = np.abs(depth - step) > 1e-9
    columns = np.flatnonzero(moved.any(axis=0))
    assert set(columns) <= {0, 39, 40, SHAPE[1] - 1}
    assert moved.any()
    assert ((depth >= 0.35 - 1e-9) & (depth <= 0.37 + 1e-9)).all()


def test_spatial_filter_rounds_small_steps_and_keeps_large_ones() -> None:
    small, large = (np.where(np.arange(SHAPE[1]) < 40, 0.35, 0.35 + by) for by in (3e-3, 20e-3))
    filtered = SpatialFilter(2e-3)
    assert seen(filtered, plane(small[None]))[30, 40] < 0.353 - 0.5e-3
    assert seen(filtered, plane(large[None]))[30, 40] == pytest.approx(0.37)


def test_spatial_filter_lowers_the_noise_and_keeps_the_mean() -> None:
    noisy = plane(seen(StereoNoise(1e-3, 0.0, 0.0), plane(0.35)))
    smooth = seen(SpatialFilter(2e-3), noisy) - 0.35
    assert smooth.std() < 0.6e-3
    assert abs(smooth.mean()) < 0.1e-3


def test_hole_filling_copies_from_the_left() -> None:
    depth = np.tile(np.linspace(0.34, 0.36, SHAPE[1]), (SHAPE[0], 1))
    depth[:, 10:13] = np.nan
    filled = seen(HoleFilling(2), plane(depth))
    assert np.all(filled[:, 10:12] == depth[:, 9:10])
    assert np.isnan(filled[:, 12]).all()


def test_decimation_takes_medians_of_four() -> None:
    image = plane(0.35)
    image.depth[0, 0] = 0.5
    image.depth[10, 10] = np.nan
    halved = Decimation().image(lambda instant: image, 0.0, np.random.default_rng(0))
    assert halved.depth.shape == (30, 40)
    assert np.all(halved.depth == 0.35)
    assert halved.rays[0, 0] == pytest.approx((image.rays[0, 0] + image.rays[1, 1]) / 2)


def test_temporal_filter_lags_behind_motion() -> None:
    speed = 0.02
    rng = np.random.default_rng(0)
    moving = TemporalFilter(0.4, True).image(lambda time: plane(0.35 + speed * time), 1.0, rng)
    late = (0.35 + speed - moving.depth[0, 0]) / speed
    assert 0.03 < late < 0.07  # (1 - alpha) / alpha frames of 1/30 s


def test_temporal_filter_keeps_the_last_reading() -> None:
    gone = plane(np.nan)

    def source(time: float) -> DepthImage:
        return plane(0.35) if time < 0.99 else gone

    rng = np.random.default_rng(0)
    assert np.all(TemporalFilter(0.4, True).image(source, 1.0, rng).depth == 0.35)
    assert np.isnan(TemporalFilter(0.4, False).image(source, 1.0, rng).depth).all()


def test_rolling_shutter_exposes_rows_in_turn() -> None:
    rng = np.random.default_rng(0)
    image = RollingShutter(0.02).image(lambda time: plane(0.35 + time), 0.0, rng)
    assert image.depth[-1, 0] - image.depth[0, 0] == pytest.approx(0.015)
    assert image.depth.mean() == pytest.approx(0.35)


def test_warm_up_moves_depth_with_time() -> None:
    rng = np.random.default_rng(0)
    warm = WarmUp(2e-3, 300.0)
    moved = [warm.image(lambda t: plane(0.35), time, rng).depth[0, 0] for time in (0.0, 3000.0)]
    assert moved == pytest.approx([0.35, 0.352], abs=1e-6)


def test_lost_and_repeated_frames() -> None:
    instants = np.arange(1000.0)
    index, stamps = LostFrames(0.1, 0.05).stamped(instants, np.random.default_rng(3))
    assert 850 < len(index) < 950
    assert np.all(np.diff(stamps) > 0)
    repeated = np.flatnonzero(instants[index] != stamps)
    assert 20 < len(repeated) < 80
    assert np.all(instants[index][repeated] == stamps[repeated] - 1)


def test_masked_tool_takes_its_rim_along() -> None:
    image = plane(0.35)
    image.what[20:30, 20:30] = 2
    depth = seen(MaskedTool(2), image)
    assert np.isnan(depth[18, 25])
    assert np.isfinite(depth[17, 25])
    assert np.isnan(depth[25, 25])


def test_gloss_blinds_a_spot_that_sways() -> None:
    gloss = Gloss(0.03, (0.02, 0.0, 0.0), 0.05)
    rng = np.random.default_rng(0)
    spots = [np.isnan(gloss.image(lambda t: plane(0.35), time, rng).depth) for time in (0.0, 3.0)]
    assert all(0 < spot.mean() < 0.5 for spot in spots)
    assert (spots[0] != spots[1]).any()


def test_dark_holes_take_their_share() -> None:
    assert np.isnan(seen(DarkHoles(0.1, 1.5), plane(0.35))).mean() == pytest.approx(0.1, abs=0.01)


def test_texture_moves_with_the_material() -> None:
    texture = Texture(0.1e-3, 5e-3, 2)
    image = plane(0.35)
    error = seen(texture, image) - 0.35
    assert error.std() == pytest.approx(0.1e-3, rel=0.3)
    moved = DepthImage(image.depth + 0.01, image.what, image.rays, image.normals, image.material)
    assert seen(texture, moved) - 0.36 == pytest.approx(error)
