from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, POSE, SETUP, SIZE, TOP, seen_points

from palpate.diagnosis.inference.evidence import Block, fit
from palpate.diagnosis.inference.noise.rest_cloud import RestCloud
from palpate.effects import Effect
from palpate.effects.geometry import GeometryScale
from palpate.effects.sensor import DepthBias
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.segmentation import Cleaner
from palpate.registration.pose import small_motion
from palpate.replay.replay import rest
from palpate.setup.box import Box
from palpate.setup.setup import Load, Setup

BLOCK = Box(size=SIZE)

SAG, NOISE, STEP = 1.5, 4e-4, 1e-3
PIVOT = np.array([0.0, 0.0, TOP])


def _sagging(weight: float) -> Setup:
    return replace(SETUP, load=Load(specific_weight_over_stiffness=weight))


def _cloud(truth: Setup, seed: int) -> FloatArray:
    """Raw rest cloud (n, 3) [m], camera frame: the block as it is, and the table around it."""
    random = np.random.default_rng(seed)
    table = random.uniform(-0.09, 0.09, (12000, 3)) * [1.0, 1.0, 0.0]
    table = table[(np.abs(table[:, :2]) > np.array(SIZE[:2]) / 2 + 0.008).any(axis=1)]
    table = camera_model_for(truth).read(table)
    away = table / np.linalg.norm(table, axis=1)[:, None]
    table = table + away * (NOISE * random.standard_normal(len(table)))[:, None]
    return np.concatenate([seen_points(rest(truth, GRID), 24000, NOISE, seed, truth), table])


def _channel(truth: Setup, pose: Transform = POSE) -> RestCloud:
    cleaner = Cleaner(geometry=BLOCK, phantom_from_camera=pose, tool_radius=5e-3, noise=NOISE)
    return RestCloud.of(
        _cloud(truth, seed=0), cleaner, replace(SETUP, phantom_from_camera=pose), GRID
    )


def _block(channel: RestCloud, setup: Setup, varied: bool = False) -> Block:
    stated = replace(setup, load=Load())
    here = setup.load.specific_weight_over_stiffness
    return channel.block(
        stated, setup, GRID, 1, {0: (_sagging(here + STEP), STEP)} if varied else {}
    )


@pytest.fixture(scope="module")
def sagged() -> RestCloud:
    """The rest cloud of a block that sags by some tenths of a millimetre."""
    return _channel(_sagging(SAG))


def test_right_sag_leaves_only_noise_and_none_leaves_more(sagged):
    right, none, twice = (_block(sagged, _sagging(weight)) for weight in (SAG, 0.0, 2 * SAG))
    assert right.gram[0, 0] < 1.2 * right.values
    assert none.gram[0, 0] > right.gram[0, 0] + 20
    assert twice.gram[0, 0] > right.gram[0, 0] + 20


def test_column_of_the_sag_leads_from_none_to_the_right_one(sagged):
    solution = fit([_block(sagged, _sagging(0.0), varied=True)], [0], np.array([[1e-6]]))
    deviation = float(np.sqrt(solution.covariance[0, 0]))
    assert solution.change[0] == pytest.approx(SAG, abs=max(3 * deviation, 0.1 * SAG))
    assert deviation < 0.3 * SAG


def test_block_that_does_not_sag_asks_for_none():
    solution = fit([_block(_channel(SETUP), _sagging(0.0), varied=True)], [0], np.array([[1e-6]]))
    assert abs(solution.change[0]) < 3 * np.sqrt(solution.covariance[0, 0])


def test_rigid_motion_of_the_camera_costs_nothing():
    motion = small_motion(np.array([3e-4, -2e-4, 4e-4, 2e-3, -2e-3, 3e-3]), PIVOT) @ POSE
    gains = []
    for pose in (POSE, motion):
        channel = _channel(_sagging(SAG), pose)
        none, right = (
            _block(channel, replace(_sagging(weight), phantom_from_camera=pose)).gram[0, 0]
            for weight in (0.0, SAG)
        )
        gains.append(none - right)
    assert gains[1] == pytest.approx(gains[0], rel=0.3)


def test_every_model_is_compared_at_the_same_places(sagged):
    values = [
        _block(sagged, _sagging(weight)).gram[0, 0] for weight in np.linspace(0.0, 2 * SAG, 7)
    ]
    # A quadratic but for the large sag's own curvature; a patch that came or went would make a
    # step.
    assert np.abs(np.diff(values, 3)).max() < 0.05 * (max(values) - min(values))
    assert (
        _block(sagged, _sagging(0.0)).values
        == _block(sagged, _sagging(SAG)).values
        == len(sagged.residual)
    )


def test_sag_does_not_pass_for_a_bad_camera(sagged):
    flat = _channel(SETUP)
    assert sagged.errors.bias <= 1.5 * flat.errors.bias
    assert sagged.errors.bias <= 2e-4  # the cloud has none


def test_only_sides_that_the_camera_sees_are_compared(sagged):
    assert (sagged.normals @ np.array([-0.19, -0.16, 0.28]) > 0).all()
    assert len(sagged.normals) > 200
    assert len(sagged.residual) - len(sagged.normals) > 50  # the table's cells


AT_REST = (DepthBias(offset=0.0, scale=1.03), GeometryScale(scale_x=1.0, scale_y=1.0, scale_z=0.96))


@pytest.mark.parametrize("effect", AT_REST, ids=lambda effect: effect.name)
def test_what_the_registration_left_of_size_and_depth_is_found_in_the_rest_cloud(effect: Effect):
    truth, step = effect.apply(SETUP), 1e-4
    name = "scale_z" if effect.name == "geometry_scale" else "scale"
    near = replace(effect.neutral(SETUP), **{name: 1.0 + step}).apply(SETUP)
    channel = _channel(truth)
    stated = channel.block(SETUP, SETUP, GRID, 1, {0: (near, step)})
    right = channel.block(SETUP, truth, GRID, 1, {})
    assert right.gram[0, 0] < 1.2 * right.values
    assert stated.gram[0, 0] > right.gram[0, 0] + 20
    solution = fit([stated], [0], np.array([[1e-6]]))
    deviation = float(np.sqrt(solution.covariance[0, 0]))
    wanted = getattr(effect, name) - 1.0
    assert solution.change[0] == pytest.approx(wanted, abs=max(3 * deviation, 0.1 * abs(wanted)))
    assert deviation < 0.3 * abs(wanted)


def test_offset_of_depth_is_a_motion_of_the_camera_but_for_a_scale_of_its_share_of_the_distance():
    distance = float(np.linalg.norm(POSE.translation - [0.0, 0.0, TOP / 2]))
    channel, far = _channel(SETUP), DepthBias(offset=2e-3, scale=1.0)
    twin = DepthBias(offset=0.0, scale=1.0 + far.offset / distance)
    cancelled = DepthBias(offset=far.offset, scale=1.0 - far.offset / distance)
    stated, moved, scaled, left = (
        channel.block(SETUP, effect.apply(SETUP), GRID, 1, {}).gram[0, 0]
        for effect in (far.neutral(SETUP), far, twin, cancelled)
    )
    assert abs(left - stated) < 0.2 * abs(moved - stated)
    assert moved - stated == pytest.approx(scaled - stated, rel=0.3)
