from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, POSE, SETUP, SIZE, TOP, seen_points

from core.cleaning import Cleaner
from core.diagnosis.evidence import Block, fit
from core.diagnosis.static import StaticChannel
from core.frames import FloatArray, Transform
from core.measurement import Surface
from core.registration import small_motion
from core.replay import rest
from core.setup import Load, Setup

SAG, NOISE, STEP = 1.5, 4e-4, 1e-3
PIVOT = np.array([0.0, 0.0, TOP])


def _sagging(weight: float) -> Setup:
    return replace(SETUP, load=Load(specific_weight_over_stiffness=weight))


def _cloud(truth: Setup, seed: int) -> FloatArray:
    """Raw rest cloud (n, 3) [m], camera frame: the sagged block and the table around it."""
    random = np.random.default_rng(seed)
    table = random.uniform(-0.09, 0.09, (12000, 3)) * [1.0, 1.0, 0.0]
    table = table[(np.abs(table[:, :2]) > np.array(SIZE[:2]) / 2 + 0.008).any(axis=1)]
    table = POSE.inverse().apply(table)
    away = table / np.linalg.norm(table, axis=1)[:, None]
    table = table + away * (NOISE * random.standard_normal(len(table)))[:, None]
    return np.concatenate([seen_points(rest(truth, GRID), 24000, NOISE, seed), table])


def _channel(truth: Setup, pose: Transform = POSE) -> StaticChannel:
    cleaner = Cleaner(size=SIZE, phantom_from_camera=pose, tool_radius=5e-3, noise=NOISE)
    return StaticChannel.of(_cloud(truth, seed=0), cleaner, bias=1.5e-4)


def _block(channel: StaticChannel, setup: Setup, varied: bool = False) -> Block:
    support = channel.support(replace(setup, load=Load()), GRID)
    here = setup.load.specific_weight_over_stiffness
    return channel.block(setup, GRID, 1, {0: (_sagging(here + STEP), STEP)} if varied else {}, support)


@pytest.fixture(scope="module")
def sagged() -> StaticChannel:
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


def test_rigid_motion_of_the_camera_costs_nothing(sagged):
    motion = small_motion(np.array([3e-4, -2e-4, 4e-4, 2e-3, -2e-3, 3e-3]), PIVOT) @ POSE
    channel = _channel(_sagging(SAG), motion)
    for weight in (0.0, SAG):
        here = _block(sagged, _sagging(weight)).gram[0, 0]
        there = _block(channel, replace(_sagging(weight), phantom_from_camera=motion)).gram[0, 0]
        assert there == pytest.approx(here, rel=0.1)


def test_table_is_averaged_over_cells_around_the_block(sagged):
    assert len(sagged.table) > 50 and not sagged.table[:, 2].any()
    assert np.sqrt(np.mean(sagged.table_gap**2 / sagged.table_variance)) == pytest.approx(1.0, abs=0.25)
    assert (np.abs(sagged.table[:, :2]) > np.array(SIZE[:2]) / 2).any(axis=1).all()


def test_only_sides_that_the_camera_sees_support_the_comparison(sagged):
    normals = Surface(SETUP.geometry).patch_normals[sagged.support(SETUP, GRID)]
    assert (normals @ np.array([-0.19, -0.16, 0.28]) > 0).all()
    assert len(normals) > 200
