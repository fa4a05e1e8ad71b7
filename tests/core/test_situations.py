from __future__ import annotations

import pytest

from benchmarks.situations import LONGEST_JUMP, draw_situation, faults
from core.replay import replay


@pytest.mark.parametrize("seed", range(16))
def test_no_situation_ends_in_nonsense(seed):
    situation = draw_situation(seed)
    frames = replay(situation.setup, situation.centres, situation.grid, times=situation.times)
    assert len(frames) == len(situation.centres)
    assert faults(situation, frames) == []
    assert any(frame.in_contact for frame in frames)


def test_situations_are_told_apart_by_their_seed_and_jump():
    first, second = draw_situation(1), draw_situation(2)
    assert first.setup != second.setup
    jump = first.centres[-1] - first.centres[-2]
    assert 0.2 * LONGEST_JUMP <= (jump @ jump) ** 0.5 <= LONGEST_JUMP
