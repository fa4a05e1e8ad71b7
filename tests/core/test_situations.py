from __future__ import annotations

import pytest

from benchmarks.situations import LONGEST_JUMP, attempt, draw_situation, faults
from core.fem.newton import Outcome
from core.replay import replay


@pytest.mark.parametrize("seed", [*range(16), 5758, 6100, 8884])  # the last three once showed a fault
def test_no_situation_ends_in_nonsense(seed):
    situation = draw_situation(seed)
    frames = replay(situation.setup, situation.centres, situation.grid, times=situation.times)
    assert len(frames) == len(situation.centres)
    assert faults(situation, frames) == []
    assert any(frame.in_contact for frame in frames)


@pytest.mark.parametrize(
    "seed",
    [
        pytest.param(700053, id="the ball slips between the points that feel it"),
        pytest.param(700012, id="the same in a material that remembers"),
        pytest.param(720057, id="pressure and friction begin from none"),
        pytest.param(720248, id="a tool on a spring balances on neither of two grids"),
    ],
)
def test_situation_that_once_had_no_equilibrium_has_one(seed):
    trial = attempt(seed)
    assert trial.found == () and set(trial.outcomes) == {Outcome.CONVERGED}


def test_situations_are_told_apart_by_their_seed_and_jump():
    first, second = draw_situation(1), draw_situation(2)
    assert first.setup != second.setup
    jump = first.centres[-1] - first.centres[-2]
    assert 0.2 * LONGEST_JUMP <= (jump @ jump) ** 0.5 <= LONGEST_JUMP
