"""Distance between tool and virtual block."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush
from palpate.synthetic.bench.virtual_experiment import solve_motion
from palpate.synthetic.scenario.scenario import Scenario
from palpate.synthetic.solver.tet_block import TetGrading, mesh_block
from palpate.synthetic.solver.tool_clearance import ToolClearance

RADIUS = 0.004
SIZE = (0.06, 0.05, 0.03)


@pytest.fixture(scope="module")
def reach():
    block = mesh_block(SIZE, TetGrading(np.zeros((1, 3)), np.zeros(1), np.full(1, 6e-3), 6e-3, 0.5))
    return ToolClearance(block.surface_rest, block.surface_normals, RADIUS, None)


@pytest.mark.parametrize("depth", [0.001, 0.006, 0.0081, 0.0095, 0.012])
def test_ball_presses_however_deep_it_is_sunk(reach, depth):
    assert reach.gap(np.array([[0.003, -0.002, SIZE[2] + RADIUS - depth]]))[0] < 0


@pytest.mark.parametrize(
    "place",
    [
        (0.003, -0.002, 0.036),
        (0.036, 0.0, 0.0299),
        (0.0299, 0.0, 0.036),
        (0.033, 0.028, 0.033),
        (0.036, 0.0249, 0.0299),
    ],
)
def test_ball_beside_the_block_does_not_press(reach, place):
    assert reach.gap(np.array([place]))[0] > 0


def test_push_by_more_than_the_ball_presses_to_its_end():
    scenario = Scenario(size=SIZE, tool_radius=RADIUS)
    top, deepest = SIZE[2] + RADIUS + 0.002, SIZE[2] + RADIUS - 0.0088
    way = np.array([[0.0, 0.0, top], [0.0, 0.0, deepest]])
    push = PlannedPush(
        way, np.array([0.0, 1.0, 1.5]), np.array([0.0, top - deepest, top - deepest])
    )
    track = solve_motion(
        scenario, MotionPlan("poke-top-01", np.array([0.0, 0.0, -1.0]), (push,), 3.0), fine=2.5e-3
    )
    pushes = [
        -key_frame.tool_force[2] for key_frame in track.solved_pushes[0].segments[0].key_frames
    ]
    assert track.motion.pushes[0].corners[-1] == pytest.approx(top - deepest)  # nothing gave way
    assert pushes == sorted(pushes)
    assert pushes[-1] > 0.1
