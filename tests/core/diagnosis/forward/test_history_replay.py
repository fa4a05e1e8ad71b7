from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, POSE, SETUP, TOP, seen_points

from palpate.dataset import Kinematics
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.history_replay import HistoryReplay, without_history
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS, JacobianRequest
from palpate.diagnosis.forward.prediction import predict
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.effects import Effect
from palpate.effects.time_dependence import PermanentSet, Viscoelasticity
from palpate.effects.tool import ToolFriction, ToolRadius
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.replay.replay import Replay, replay, rest

DURATION, DENSE = 5.0, 0.05
EFFECTS: dict[str, Effect] = {
    "viscoelasticity": Viscoelasticity(relaxed_fraction=0.5, time_constant=0.8),
    "permanent_set": PermanentSet(retained_fraction=0.2),
    "tool_friction": ToolFriction(friction_coefficient=0.4),
}
FEW = (0.1, 1.2, 2.0, 2.7, 3.4, 4.9)
"""When the groups were seen [s]: before, in the drag, in the hold, and three times after the
release."""


def _centres(time: FloatArray) -> FloatArray:
    """Down by 4 mm within a second, 6 mm aside until 1.6 s, there until 2.2 s, and away; tool
    centres (n, 3) [m].
    """
    depth = np.interp(time, [0.2, 1.0, 2.2, 2.6], [-8e-3, 4e-3, 4e-3, -8e-3])
    aside = np.interp(time, [1.0, 1.6], [-3e-3, 3e-3])
    return np.stack([aside, np.full_like(time, -2e-3), TOP + 5e-3 - depth], axis=1)


@pytest.fixture(scope="module")
def data() -> Observations:
    """Six looks, of the untouched block's points: how a replay gets from one to the next is what is
    asked.
    """
    stream = np.arange(0, DURATION, 2e-3)
    kinematics = Kinematics(
        stream, _centres(stream), np.tile([0.0, 0.0, 0.0, 1.0], (len(stream), 1))
    )
    points = seen_points(rest(SETUP, GRID), 3000, 0.0, 1)
    groups = (
        Group((), points, True, True),
        *(Group((number,), points, number in (0, 3, 4, 5)) for number in range(len(FEW))),
    )
    return Observations("drag-01", np.array(FEW), kinematics, groups)


@pytest.fixture(scope="module", params=EFFECTS)
def effect(request: pytest.FixtureRequest) -> Effect:
    return EFFECTS[request.param]


def _by_every_step(effect: Effect) -> list[FloatArray]:
    """Displacements (n, 3) [m] at the looks, from a replay that leaves nothing out."""
    times = np.unique(np.round(np.concatenate([np.arange(FEW[0], FEW[-1], DENSE), FEW]), 6))
    frames = replay(effect.apply(SETUP), _centres(times), GRID, times=times)
    return [frames[int(np.argmin(np.abs(times - time)))].displacement for time in FEW]


def test_a_cloud_depends_on_what_was_done_between_clouds(data, effect):
    found = predict(data, effect.apply(SETUP), GRID)
    assert not found.failed and not found.equilibria[0].in_contact
    dense = _by_every_step(effect)
    jumped = replay(effect.apply(SETUP), _centres(np.array(FEW)), GRID, times=np.array(FEW))
    largest = max(float(np.abs(each).max()) for each in dense)
    led, leapt = (
        max(
            float(np.abs(frame.displacement - exact).max())
            for frame, exact in zip(frames, dense, strict=True)
        )
        / largest
        for frames in (found.equilibria[1:], jumped)
    )
    assert led < 0.03
    assert leapt > 0.05  # or the way would not matter


def test_the_block_is_still_moving_after_the_release(data):
    frames = predict(data, EFFECTS["viscoelasticity"].apply(SETUP), GRID).equilibria[4:]
    left = [float(np.abs(frame.displacement).max()) for frame in frames]
    assert not any(frame.in_contact for frame in frames)
    # A standard linear solid recovers with its retardation time, tau / (1 - relaxed fraction) = 1.6
    # s.
    assert left[0] > 2e-4
    assert left[2] / left[1] == pytest.approx(np.exp(-(FEW[5] - FEW[4]) / 1.6), rel=0.1)


def test_columns_are_those_without_memory(data, effect):
    step, setup = 1e-6, effect.apply(SETUP)
    pivot = np.array([0.0, 0.0, TOP])

    def wanted(base):
        return JacobianRequest(
            setups=(ToolRadius(radius=5e-3 + step).apply(base),), steps=(step,), pivot=pivot
        )

    plain = predict(data, SETUP, GRID, wanted(SETUP))
    found = predict(data, setup, GRID, wanted(setup), plain.equilibria, samples=plain.samples)
    assert np.allclose(found.columns, plain.columns, atol=1e-3)
    assert np.abs(found.columns[2, :, TOOL_COLUMNS]).max() > 0.1
    assert np.nanmax(np.abs(found.gap - plain.gap)) > 5e-5


def test_no_step_is_longer_than_a_drag_or_a_hold_can_be(data):
    block = Replay(EFFECTS["viscoelasticity"].apply(SETUP), GRID)
    past, visited = HistoryReplay(data, block, Transform()), []
    step = block.step

    def watched(centre, start=None, time=None):
        visited.append((time, centre))
        return step(centre, start, time)

    block.step = watched  # type: ignore[method-assign]
    for group, centre in zip(data.groups, data.centres(block.setup), strict=True):
        past.reach(centre, data.instant(group, block.setup))
    times = np.array([time for time, _ in visited])
    assert np.all(np.diff(times) > 0)
    held = times[(times > 0.8) & (times < 2.3)]
    assert np.diff(held).max() < 0.45
    moved = np.linalg.norm(
        np.diff([centre for time, centre in visited if 0.8 < time < 2.3], axis=0), axis=1
    )
    # A step ends with the first pose of the tool that is too far.
    assert moved.max() < CRITERIA.history.travel + 0.6e-3


def test_setup_without_history_keeps_everything_else():
    setup = replace(SETUP, phantom_from_camera=POSE)
    for effect in EFFECTS.values():
        setup = effect.apply(setup)
    assert setup.has_history and not without_history(setup).has_history
    assert without_history(setup) == without_history(replace(SETUP, phantom_from_camera=POSE))
