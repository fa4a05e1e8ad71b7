from __future__ import annotations

import numpy as np
from pushed_block import GRID, POSE, SETUP, SIZE

from core.diagnosis.comparison import Compared, choose, compare
from core.diagnosis.observations import Group
from core.effects.sensor import CameraRegistration
from core.measurement import Surface
from core.replay import rest
from core.setup import Setup
from core.sight import sight_of

SURFACE, BLOCK = Surface(SETUP.box), rest(SETUP, GRID)
SHIFT = np.array([5e-3, 1e-3, 0.0])
MOVED = CameraRegistration(tx=5e-3, ty=1e-3, tz=0.0, rx=0.0, ry=0.0, rz=0.0).apply(SETUP)


def _compared(beyond: float, setup: Setup) -> Compared:
    """Points of a side next to its far edge, `beyond` it [m], by a camera that is off by SHIFT; sampled by the stated setup."""
    random = np.random.default_rng(0)
    points = np.column_stack([
        SIZE[0] / 2 + beyond + random.uniform(-1e-5, 1e-5, 60), np.full(60, -SIZE[1] / 2), random.uniform(0.012, 0.024, 60)
    ])  # fmt: skip
    group = Group((0,), POSE.inverse().apply(points - SHIFT), False)
    return compare(group, setup, BLOCK, SURFACE, choose(group, SETUP, BLOCK, SURFACE))


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
    moved = sight_of(side).place(sight_of(MOVED).read(found.points))
    change = found.along_sight(moved)[found.means.count > 0]
    assert np.allclose(change, -1e-4, atol=1e-6)


def test_gap_does_not_jump_where_a_rim_passes_the_ray():
    """Points just inside the far edge of the top: lower the block and their rays pass over it to nothing, or to the side."""
    random = np.random.default_rng(1)
    places = np.column_stack([
        SIZE[0] / 2 - 1.6e-3 + random.uniform(-5e-5, 5e-5, 40), random.uniform(0.0, 0.004, 40), np.full(40, SIZE[2])
    ])  # fmt: skip
    group = Group((0,), POSE.inverse().apply(places), False)
    sample = choose(group, SETUP, BLOCK, SURFACE)
    for lift in (0.5e-3, 1e-3, 2e-3, 4e-3):
        lifted = CameraRegistration(tx=0.0, ty=0.0, tz=lift, rx=0.0, ry=0.0, rz=0.0).apply(SETUP)
        found = compare(group, lifted, BLOCK, SURFACE, sample).means
        # The gap counts along the ray, times the cosine that the stated surface has: the height by which the points lie off it.
        assert np.allclose(found.mean[found.count > 0], lift, atol=1e-5)
