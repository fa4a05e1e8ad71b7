"""Changes of a frame's displacement, against full solves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pushed_block import GRID, SETUP, SIZE, poke

from palpate.fem.mesh_quadrature import element_quadrature
from palpate.foundation.arrays import FloatArray
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.frame_tangent import factorise_at
from palpate.gradients.setup_change import TOOL_STEP
from palpate.gradients.stiffness_derivatives import stiffness_changes
from palpate.replay.replay import Replay
from palpate.setup.setup import Load, Sensor, Setup, Support

TIGHT = 1e-10


def _relative(found: FloatArray, wanted: FloatArray) -> float:
    assert np.linalg.norm(wanted) > 0
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


def test_tool_motion_equals_full_solves(pushed):
    block, frame = pushed
    found = (
        displacement_changes(block, frame, [(SETUP, TOOL_STEP * axis) for axis in np.eye(3)])
        / TOOL_STEP
    )
    for axis, change in zip(np.eye(3), found, strict=True):
        ahead, behind = (
            block.step(poke(4e-3) + sign * 1e-6 * axis, frame).displacement for sign in (1, -1)
        )
        assert _relative(change, (ahead - behind) / 2e-6) < 0.02


def test_sensor_alone_moves_nothing(pushed):
    block, frame = pushed
    late = replace(SETUP, sensor=Sensor(time_offset=0.1))
    assert not displacement_changes(block, frame, [(late, np.zeros(3))]).any()


def test_changes_are_linear_in_the_step(pushed):
    block, frame = pushed

    def softer(change: float) -> Setup:
        return replace(SETUP, material=replace(SETUP.material, poisson_ratio=0.45 + change))

    one, two = displacement_changes(
        block, frame, [(softer(1e-4), np.zeros(3)), (softer(2e-4), np.zeros(3))]
    )
    assert _relative(two, 2 * one) < 5e-3


def test_untouched_block_responds_to_weight_only():
    block = Replay(SETUP, GRID)
    frame = block.step(poke(-9e-3))
    assert not displacement_changes(block, frame, [(SETUP, np.array([0.0, 0.0, TOOL_STEP]))]).any()
    assert not stiffness_changes(
        block, frame, np.ones((2, *element_quadrature(frame.mesh).weights.shape))
    ).any()
    sagging = Replay(replace(SETUP, load=Load(specific_weight_over_stiffness=1.5)), GRID)
    heavier = replace(SETUP, load=Load(specific_weight_over_stiffness=1.501))
    assert (
        displacement_changes(sagging, sagging.step(poke(-9e-3)), [(heavier, np.zeros(3))])[
            0, :, 2
        ].min()
        < 0
    )


def test_no_changes_need_no_solve(pushed):
    block, frame = pushed
    assert displacement_changes(block, frame, []).shape == (0, *frame.displacement.shape)
    assert factorise_at(block, frame) is not None


def test_slipped_base_stays_fixed_in_the_changes_of_one_frame():
    """The slip itself depends on earlier frames, and has no derivative in a single one."""
    loose = replace(SETUP, support=Support(friction_coefficient=0.1))
    softer = replace(loose, material=replace(loose.material, poisson_ratio=0.451))
    block, frame = Replay(loose, GRID, TIGHT), None
    for depth in (1e-3, 2e-3, 3e-3, 4e-3):
        frame = block.step(np.array([-SIZE[0] / 2 - 5e-3 + depth, 1e-3, 0.02]), frame)
    assert frame is not None and frame.slip[0] > 5e-4
    other = Replay(softer, GRID, TIGHT)
    other.slip = frame.slip.copy()
    wanted = other.solve_with_fixed_base(frame.tool, frame).displacement - frame.displacement
    assert _relative(displacement_changes(block, frame, [(softer, np.zeros(3))])[0], wanted) < 0.02
    slippery = replace(loose, support=Support(friction_coefficient=0.099))
    assert not displacement_changes(block, frame, [(slippery, np.zeros(3))]).any()
