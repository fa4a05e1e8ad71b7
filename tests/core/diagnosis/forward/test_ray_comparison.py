from __future__ import annotations

from dataclasses import replace

import numpy as np
from pushed_block import GRID, POSE, SETUP, SIZE

from palpate.diagnosis.forward.ray_comparison import PointComparison, choose_points, compare
from palpate.diagnosis.observation.frame_groups import Group
from palpate.effects.sensor import CameraRegistration, DepthBias
from palpate.measurement.camera_model import camera_model_for
from palpate.replay.replay import rest
from palpate.setup.setup import Setup

SURFACE, BLOCK = SETUP.surface(), rest(SETUP, GRID)
SHIFT = np.array([5e-3, 1e-3, 0.0])
MOVED = CameraRegistration(tx=5e-3, ty=1e-3, tz=0.0, rx=0.0, ry=0.0, rz=0.0).apply(SETUP)


def _compared(beyond: float, setup: Setup) -> PointComparison:
    """Points of a side next to its far edge, `beyond` it [m], by a camera that is off by SHIFT;
    sampled by the stated setup.
    """
    random = np.random.default_rng(0)
    points = np.column_stack(
        [
            SIZE[0] / 2 + beyond + random.uniform(-1e-5, 1e-5, 60),
            np.full(60, -SIZE[1] / 2),
            random.uniform(0.012, 0.024, 60),
        ]
    )
    group = Group((0,), POSE.inverse().apply(points - SHIFT), False)
    return compare(group, setup, BLOCK, SURFACE, choose_points(group, SETUP, BLOCK, SURFACE))


def test_points_lie_off_the_stated_block_by_the_cameras_shift():
    stated = _compared(5e-5, SETUP).means
    assert stated.count.sum() == 60
    assert np.allclose(stated.mean[stated.count > 0], 1e-3, atol=2e-5)


def test_ray_that_misses_the_true_block_does_not_count_against_it():
    for beyond in (5e-5, 3e-4):
        found = _compared(beyond, MOVED)
        assert len(found.seen.index) == found.means.count.sum() > 20
        assert np.allclose(found.means.mean[found.means.count > 0], 0.0, atol=2e-5)


def test_ray_that_misses_feels_how_the_surface_moves():
    found = _compared(5e-5, MOVED)
    side = CameraRegistration(tx=5e-3, ty=1.1e-3, tz=0.0, rx=0.0, ry=0.0, rz=0.0).apply(SETUP)
    moved = camera_model_for(side).place(camera_model_for(MOVED).read(found.places))
    change = found.along_sight(moved)[found.means.count > 0]
    assert np.allclose(change, -1e-4, atol=1e-6)


def test_gap_does_not_jump_where_a_rim_passes_the_ray():
    """Points just inside the far edge of the top: lower the block and their rays pass over it to
    nothing, or to the side.
    """
    random = np.random.default_rng(1)
    places = np.column_stack(
        [
            SIZE[0] / 2 - 1.6e-3 + random.uniform(-5e-5, 5e-5, 40),
            random.uniform(0.0, 0.004, 40),
            np.full(40, SIZE[2]),
        ]
    )
    group = Group((0,), POSE.inverse().apply(places), False)
    sample = choose_points(group, SETUP, BLOCK, SURFACE)
    for lift in (0.5e-3, 1e-3, 2e-3, 4e-3):
        lifted = CameraRegistration(tx=0.0, ty=0.0, tz=lift, rx=0.0, ry=0.0, rz=0.0).apply(SETUP)
        found = compare(group, lifted, BLOCK, SURFACE, sample).means
        # The gap counts along the ray, times the cosine that the stated surface has: the height by
        # which the points lie off it.
        assert np.allclose(found.mean[found.count > 0], lift, atol=1e-5)


def test_points_of_a_side_that_lie_too_low_are_not_chosen():
    heights = np.linspace(2e-3, 12e-3, 200)
    points = np.column_stack([np.linspace(-0.02, 0.02, 200), np.full(200, -SIZE[1] / 2), heights])
    group = Group((0,), POSE.inverse().apply(points), False)
    assert len(choose_points(group, SETUP, BLOCK, SURFACE).index) == 200
    low = choose_points(replace(group, lowest=5e-3), SETUP, BLOCK, SURFACE)
    assert np.array_equal(low.index, np.flatnonzero(heights >= 5e-3))


def _top(noise: float) -> Group:
    """Points of the top with noise along the rays [m], as a camera that reads depth as it is sees
    them.
    """
    random = np.random.default_rng(2)
    places = np.column_stack(
        [
            random.uniform(-0.02, 0.02, 4000),
            random.uniform(-0.01, 0.01, 4000),
            np.full(4000, SIZE[2]),
        ]
    )
    points = POSE.inverse().apply(places)
    away = points / np.linalg.norm(points, axis=1)[:, None]
    return Group((0,), points + noise * random.standard_normal((4000, 1)) * away, False)


def test_model_that_shrinks_the_cloud_does_not_shrink_its_noise():
    group = _top(8e-4)
    sample = choose_points(group, SETUP, BLOCK, SURFACE)
    spreads = []
    for scale in (1.0, 1.1):
        setup = DepthBias(offset=0.0, scale=scale).apply(SETUP)
        means = compare(group, setup, BLOCK, SURFACE, sample).means
        spreads.append(means.spread[means.count > 20])
    assert np.allclose(spreads[1], spreads[0], rtol=0.02)


def test_column_of_a_stretch_is_the_difference_of_two_models_and_free_of_noise():
    step = 1e-4
    near = DepthBias(offset=0.0, scale=1.0 + step).apply(SETUP)
    columns, means = [], []
    for noise in (8e-4, 0.0):
        group = _top(noise)
        sample = choose_points(group, SETUP, BLOCK, SURFACE)
        here, there = (compare(group, setup, BLOCK, SURFACE, sample) for setup in (SETUP, near))
        moved = camera_model_for(near).place(camera_model_for(SETUP).read(here.places))
        columns.append(here.along_sight(moved, camera_model_for(near).scale) / step)
        means.append(np.nan_to_num(here.means.mean))
        difference = np.nan_to_num(there.means.mean - here.means.mean) / step
        assert np.allclose(columns[-1], difference, atol=2e-3)
    seen = np.abs(columns[1]) > 0
    assert seen.sum() > 20 and np.abs(means[0]).max() > 2e-4
    # A column that took its noise from the residual would explain it.
    assert abs(np.corrcoef((columns[0] - columns[1])[seen], means[0][seen])[0, 1]) < 0.5
    assert np.std((columns[0] - columns[1])[seen]) < 0.2 * np.std(means[0][seen])


def test_column_of_a_turn_does_not_turn_the_noise():
    """A camera that turns about itself leaves every gap along its ray, noise and all; only where
    the rays pass has changed.
    """
    turn = CameraRegistration(tx=0.0, ty=0.0, tz=0.0, rx=2e-3, ry=0.0, rz=0.0).apply(SETUP)
    group = _top(8e-4)
    sample = choose_points(group, SETUP, BLOCK, SURFACE)
    here, there = (compare(group, setup, BLOCK, SURFACE, sample) for setup in (SETUP, turn))
    column = here.along_sight(
        camera_model_for(turn).place(camera_model_for(SETUP).read(here.places))
    )
    seen = here.means.count > 20
    change = (there.means.mean - here.means.mean)[seen]
    # Each patch's share of its own residual that a change of two milliradians makes: to first order
    # none is the column's fault.
    noise = here.means.mean[seen]
    assert (
        np.abs(noise).max() > 1e-4
        and np.abs(change - column[seen]).max() < 0.02 * np.abs(change).max()
    )
    slope = float((change - column[seen]) @ noise / (noise @ noise))
    assert abs(slope) < 2e-4
