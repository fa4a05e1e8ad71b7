"""Pushes that take more work than their budget."""

from __future__ import annotations

import numpy as np
import pytest
from pushed_block import GRID, SETUP, TOP

from benchmarks.situations import draw_situation
from palpate.fem.model import BlockModel
from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.replay import work_budget
from palpate.replay.replay import replay
from palpate.replay.work_budget import WorkBudget, WorkSpentError

RADIUS = SETUP.tool.radius
DEPTHS = (-2e-3, 1e-3, 3e-3, 5e-3, 5.2e-3, -2e-3, 1e-3, 1.2e-3)
CENTRES = np.array([[0.0, 0.0, TOP + RADIUS - depth] for depth in DEPTHS])


def test_push_beyond_its_budget_is_given_up_and_the_next_one_is_replayed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = replay(SETUP, CENTRES, GRID)
    assert {frame.outcome for frame in whole} == {Outcome.CONVERGED}
    # The small budget is between the work of the light second push and that of the first.
    monkeypatch.setattr(work_budget, "PER_PUSH", 12.0)
    monkeypatch.setattr(work_budget, "PER_FRAME", 0.0)
    frames = replay(SETUP, CENTRES, GRID)
    given_up = [frame.outcome is Outcome.GIVEN_UP for frame in frames]
    first = given_up.index(True)
    assert 1 < first < 5 and given_up == [False] * first + [True] * (5 - first) + [False] * 3
    for one, other in zip(frames[:first] + frames[5:], whole[:first] + whole[5:], strict=True):
        assert np.allclose(one.displacement, other.displacement, atol=1e-7)


def test_extreme_push_takes_no_more_factorisations_than_are_stated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    counted, factorise = [0], BlockModel.factorise

    def count(model: BlockModel, data: FloatArray) -> None:
        counted[0] += 1
        factorise(model, data)

    monkeypatch.setattr(BlockModel, "factorise", count)
    # A jump of a tool with a spring and friction, of which the last step takes thousands.
    extreme = draw_situation(139, by_size=0.0)
    frames = replay(extreme.setup, extreme.centres, extreme.grid, times=extreme.times)
    assert counted[0] <= 2000 + 20 * len(frames)
    assert [frame.outcome.name for frame in frames] == ["CONVERGED"] * 6 + ["GIVEN_UP"]


def test_work_of_a_push_is_bounded_and_each_push_has_its_own() -> None:
    budget = WorkBudget()
    for _ in range(2):
        budget.begin_frame(clear=True)
        budget.spend(work_budget.PER_PUSH)
        budget.begin_frame(clear=False)
        budget.spend(2 * work_budget.PER_FRAME)
        assert not budget.given_up
        with pytest.raises(WorkSpentError):
            budget.spend(1.0)
        assert budget.given_up


def test_replay_tells_what_time_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[str] = []
    monkeypatch.setattr("palpate.replay.replay._TELLING", 0.0, raising=False)
    replay(SETUP, CENTRES, GRID, report=lambda _, text: told.append(text))
    assert told[0] == "frame 1 of 8" and told[-1].startswith("frame 8 of 8, about ")
    assert told[-1].endswith(" s left")


def test_work_between_frames_does_not_count() -> None:
    """Derivatives at a frame are solved outside of it, where nothing could be given up."""
    budget = WorkBudget()
    budget.begin_frame(clear=True)
    budget.end_frame()
    budget.spend(1e9)
    assert not budget.given_up
    budget.begin_frame(clear=False)
    with pytest.raises(WorkSpentError):
        budget.spend(1e9)
    assert budget.given_up
