"""One push on the virtual block, from above or from the side, with something hidden in it."""

from __future__ import annotations

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.bench.motion_plan import MotionPlan, PlannedPush
from palpate.synthetic.bench.solved_track import SolvedTrack
from palpate.synthetic.bench.virtual_experiment import solve_motion
from palpate.synthetic.scenario.hidden_effects import HiddenEffect
from palpate.synthetic.scenario.scenario import Scenario

COARSE = 3.6e-3
RADIUS = Scenario().tool_radius
X, Y, Z = Scenario().size
CLEAR = 4e-3
"""Distance from the block at which a push begins [m]."""


def way(depth: float, side: bool = False) -> FloatArray:
    """Stated centres (2, 3) [m] of a push: where it begins, and `depth` into the top, or into the
    side at +y.
    """
    start = np.array([2e-3, Y / 2 + RADIUS, 0.023] if side else [4e-3, 2e-3, Z + RADIUS])
    inwards = np.array([0.0, -1.0, 0.0] if side else [0.0, 0.0, -1.0])
    return np.stack([start - CLEAR * inwards, start + depth * inwards])


def hide(effect: str, **parameters: float | str) -> HiddenEffect:
    return HiddenEffect(effect, parameters)


def simulate_push(
    *effects: HiddenEffect, depth: float = 4e-3, side: bool = False, fine: float = COARSE
) -> SolvedTrack:
    """Push in one second, hold for another, and retract."""
    waypoints = way(depth, side)
    length = CLEAR + depth
    push = PlannedPush(
        waypoints, np.array([1.0, 2.0, 3.0, 4.0]), np.array([0.0, length, length, 0.0])
    )
    return solve_motion(
        Scenario(effects=effects),
        MotionPlan("poke-top-01", np.array([0.0, 0.0, -1.0]), (push,), 5.0),
        fine,
    )
