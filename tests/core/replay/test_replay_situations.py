from __future__ import annotations

from dataclasses import replace

import pytest

from benchmarks.situations import GRIDS, LONGEST_JUMP, attempt, draw_situation, faults
from palpate.fem.newton import Outcome
from palpate.replay.replay import replay


@pytest.mark.parametrize(
    "seed", [*range(16), 5758, 6100, 8884]
)  # the last three once showed a fault
def test_every_situation_has_a_valid_outcome(seed):
    situation = draw_situation(seed)
    frames = replay(situation.setup, situation.centres, situation.grid, times=situation.times)
    assert len(frames) == len(situation.centres)
    assert faults(situation, frames) == []
    assert any(frame.in_contact for frame in frames)


@pytest.mark.parametrize(
    ("seed", "grid"),
    [
        pytest.param(700053, GRIDS[0], id="the ball slips between the points that feel it"),
        pytest.param(700012, GRIDS[2], id="the same in a material with history"),
        pytest.param(720057, GRIDS[1], id="pressure and friction begin from none"),
        pytest.param(720248, GRIDS[1], id="a tool on a spring balances on neither of two grids"),
    ],
)
def test_difficult_situations_have_an_equilibrium(seed, grid):
    situation = replace(draw_situation(seed), grid=grid)
    frames = replay(situation.setup, situation.centres, situation.grid, times=situation.times)
    assert faults(situation, frames) == [] and {frame.outcome for frame in frames} == {
        Outcome.CONVERGED
    }


def test_trial_reports_its_seed_effects_and_grid():
    trial = attempt(5)
    assert trial.faults == () and len(trial.outcomes) == len(draw_situation(5).centres)
    assert str(trial).startswith("seed 5 (") and "by size" in str(trial)


def test_situations_differ_by_seed_and_jump():
    first, second = draw_situation(1), draw_situation(2)
    assert first.setup != second.setup
    jump = first.centres[-1] - first.centres[-2]
    assert 0.2 * LONGEST_JUMP <= (jump @ jump) ** 0.5 <= LONGEST_JUMP
