"""The paper's protocol: twelve sequences, 14 minutes, two of them for validation, and one kind of
motion that nothing trains on.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.synthetic import PAPER_SIZES, PaperSize, Scenario, paper_scenario
from palpate.synthetic.bench.motion_plan import MotionPlan, draw_motion

SEEN = np.array([1.0, -1.0])


def _kind(name: str) -> str:
    return name.rpartition("-")[0]


def _motions(scenario: Scenario) -> dict[str, MotionPlan]:
    numbers = {
        name: [_kind(one) for one in scenario.sequences[:at]].count(_kind(name))
        for at, name in enumerate(scenario.sequences)
    }
    return {
        name: draw_motion(
            name,
            number,
            scenario.size,
            scenario.tool_radius,
            SEEN,
            2020,
            scenario.rounds.get(name, 1),
        )
        for name, number in numbers.items()
    }


def test_full_protocol_is_twelve_sequences_of_fourteen_minutes_with_two_for_validation():
    scenario = paper_scenario("full")
    motions = _motions(scenario)
    assert len(motions) == 12
    assert sum(motion.duration for motion in motions.values()) / 60 == pytest.approx(14, abs=0.4)
    assert [round(motions[name].duration / 60) for name in scenario.splits["validation"]] == [2]
    assert scenario.rate == 30.0


@pytest.mark.parametrize("size", PAPER_SIZES)
def test_one_kind_of_motion_is_tested_that_nothing_trains_on(size: PaperSize):
    scenario = paper_scenario(size)
    known = {_kind(name) for split in ("train", "validation") for name in scenario.splits[split]}
    tested = {_kind(name) for name in scenario.splits["test"]}
    assert tested & known == {"poke-top", "poke-side"} and tested - known == {"drag"}


@pytest.mark.parametrize("size", PAPER_SIZES)
def test_splits_name_each_sequence_once(size: PaperSize):
    scenario = paper_scenario(size)
    assert sorted(name for names in scenario.splits.values() for name in names) == sorted(
        scenario.sequences
    )


def test_medium_protocol_has_the_sequences_of_the_full_one():
    assert paper_scenario("medium").splits == paper_scenario("full").splits


def test_further_rounds_go_on_from_the_first_and_touch_at_other_places():
    one, more = (
        draw_motion("poke-top-01", 0, (0.0687, 0.0393, 0.0358), 5e-3, SEEN, 3, rounds)
        for rounds in (1, 3)
    )
    assert (len(one.pushes), len(more.pushes)) == (3, 9)
    firsts = [push.waypoints[0] for push in more.pushes]
    np.testing.assert_array_equal(firsts[0], one.pushes[0].waypoints[0])
    assert np.ptp([place[0] for place in firsts]) > 0.02  # along the block
    ends = [float(push.times[-1]) for push in more.pushes]
    assert all(
        before < float(push.times[0]) for before, push in zip(ends, more.pushes[1:], strict=False)
    )
