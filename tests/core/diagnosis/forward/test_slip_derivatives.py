"""A base that slides goes further with all that presses harder, and stays where it has gone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, SETUP, SIZE, TOP, observed

from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS, JacobianRequest
from palpate.diagnosis.forward.prediction import Prediction, predict
from palpate.diagnosis.observation.frame_groups import FAR, Observations
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.replay import replay as replay_module
from palpate.replay.replay import Replay
from palpate.setup.setup import Load, Setup, Support, Tool

SLIDING = replace(
    SETUP, support=Support(friction_coefficient=0.1), load=Load(specific_weight_over_stiffness=1.0)
)
PIVOT = np.array([0.0, 0.0, TOP])
TIGHT = 1e-8


def _pushed(depth: float) -> FloatArray:
    """Centre (3,) [m] of the ball pressed into the side that faces the camera."""
    return np.array([-SIZE[0] / 2 - 5e-3 + depth, 2e-3, 0.02])


CENTRES = np.array([FAR, _pushed(1e-3), _pushed(5e-3), _pushed(6.5e-3), _pushed(4e-3), FAR])

# The setup changed by so much, a number of its own or the tool's motion.
CHANGED = {
    "tool along x": lambda step: replace(SLIDING, tool=Tool(radius=5e-3, offset=(step, 0.0, 0.0))),
    "radius": lambda step: replace(SLIDING, tool=Tool(radius=5e-3 + step)),
    "friction": lambda step: replace(SLIDING, support=Support(friction_coefficient=0.1 + step)),
    "weight": lambda step: replace(SLIDING, mass=SLIDING.mass + step),
    "sag": lambda step: replace(SLIDING, load=Load(specific_weight_over_stiffness=1.0 + step)),
    "poisson ratio": lambda step: replace(
        SLIDING, material=replace(SLIDING.material, poisson_ratio=0.45 - step)
    ),
}
STEPS = {
    "tool along x": 1e-4,
    "radius": 1e-4,
    "friction": 4e-3,
    "weight": 4e-3,
    "sag": 0.1,
    "poisson ratio": 0.01,
}


@pytest.fixture(scope="module")
def data() -> Observations:
    return observed(SLIDING, CENTRES, noise=0.0)


@pytest.fixture(scope="module")
def here(data) -> Prediction:
    small = [1e-3 * step for step in STEPS.values()]
    setups = tuple(CHANGED[name](step) for name, step in zip(STEPS, small, strict=True))
    return predict(
        data,
        SLIDING,
        GRID,
        JacobianRequest(setups=setups, steps=tuple(small), pivot=PIVOT),
        tolerance=TIGHT,
    )


def test_block_slides_and_stays(here):
    gone = [float(frame.slip[0]) for frame in here.equilibria]
    assert gone[0] == gone[1] == 0.0 and gone[2] > 1e-3 and gone[3] > gone[2] + 1e-3
    assert gone[3] == gone[4] == gone[5]
    assert not here.equilibria[5].in_contact


def _differences(data: Observations, here: Prediction, name: str) -> tuple[FloatArray, FloatArray]:
    """What the column says and what two replays do (g, p), zero where unseen."""
    step = STEPS[name]
    ahead, behind = (
        predict(
            data, CHANGED[name](sign * step), GRID, None, here.equilibria, TIGHT, here.samples
        ).gap
        for sign in (1, -1)
    )
    wanted = (ahead - behind) / (2 * step)
    found = np.where(
        np.isfinite(wanted), here.columns[..., TOOL_COLUMNS + list(STEPS).index(name)], 0.0
    )
    return found, np.nan_to_num(wanted)


@pytest.mark.parametrize("name", STEPS)
def test_column_is_the_difference_of_two_replays(data, here, name):
    found, wanted = _differences(data, here, name)
    assert np.linalg.norm(wanted[-1]) > 0  # the tool is gone, and what it moved has stayed
    # On coarse elements the force of a push has kinks, which count where little else is moved.
    tolerance = 0.15 if name == "poisson ratio" else 0.05
    assert np.linalg.norm(found - wanted) < tolerance * np.linalg.norm(wanted)
    assert np.linalg.norm(found[-1] - wanted[-1]) < tolerance * np.linalg.norm(wanted[-1])


def test_side_that_is_pushed_goes_with_the_tool(data, here):
    found, _ = _differences(data, here, "tool along x")
    assert np.abs(found[-1]).max() == pytest.approx(
        1.0, abs=0.15
    )  # 0 of a base that stays where it is


@pytest.mark.parametrize("steps", [1, 3, 9])
def test_how_far_it_slides_hangs_not_on_how_often_one_looks(steps):
    block = Replay(SLIDING, GRID, 1e-6)
    frame = block.free
    for depth in np.linspace(0.0, 6e-3, steps + 1)[1:]:
        frame = block.solve_from_any(_pushed(float(depth)), (frame,))
    assert frame.outcome is Outcome.CONVERGED
    held = SLIDING.support.friction_coefficient * (SLIDING.mass * 9.81 + frame.force[2])
    assert np.linalg.norm(frame.force[:2]) == pytest.approx(held, rel=2e-3)


def _free(setup: Setup) -> Setup:
    return replace(setup, support=Support())


def test_base_that_is_held_has_the_columns_it_had(data):
    wanted = JacobianRequest(setups=(_free(CHANGED["radius"](1e-7)),), steps=(1e-7,), pivot=PIVOT)
    found = predict(data, _free(SLIDING), GRID, wanted, tolerance=TIGHT)
    assert not found.columns[-1, :, :3].any()


def test_patch_that_slid_from_under_its_points_is_told(data):
    """The far edge of the top has gone, and what lay on it is seen on the side, or on nothing."""
    stated = predict(data, _free(SLIDING), GRID)
    found = predict(data, SLIDING, GRID, None, None, 3e-4, stated.samples)
    assert found.other_side is not None and stated.other_side is not None
    assert not stated.other_side.any()
    assert not (found.other_side[1] > 0.2).any() and (found.other_side[-1] > 0.2).any()


def test_base_that_finds_no_rest_is_told_and_stays_where_it_was(monkeypatch):
    monkeypatch.setattr(replay_module, "_MOST_SLIDES", 1)
    block = Replay(SLIDING, GRID, 1e-6)
    frame = block.step(_pushed(5e-3))
    assert frame.outcome is Outcome.BASE_SLIDES and "friction" in frame.outcome.value
    assert not block.slip.any()
