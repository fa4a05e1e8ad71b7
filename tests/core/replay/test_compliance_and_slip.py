"""A tool with a compliant shaft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.newton import Outcome
from palpate.foundation.errors import SolveError
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import replay, require_converged
from palpate.setup.setup import Box, Load, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)
POKE = np.array([[5e-3, 2e-3, SIZE[2] + 5e-3 - depth] for depth in (-2e-3, 1e-3, 3e-3, 5e-3)])
SIDE = np.array([[SIZE[0] / 2 + 5e-3 - depth, 1e-3, 0.022] for depth in (1e-3, 3e-3, 5e-3)])


def _compliant(compliance: float, setup: Setup = SETUP) -> Setup:
    return replace(setup, tool=replace(setup.tool, compliance_times_stiffness=compliance))


@pytest.mark.parametrize("compliance", [1.0, 30.0, 400.0])
@pytest.mark.parametrize("way", [POKE, SIDE], ids=["poke", "side"])
def test_tool_is_where_its_spring_balances_the_block(way, compliance):
    setup = _compliant(compliance)
    frames = replay(setup, way, GRID)
    require_converged(frames)
    for stated, frame in zip(way, frames, strict=True):
        wanted = stated + compliance / setup.material.young_modulus * frame.force
        assert frame.tool.centre == pytest.approx(wanted, abs=2e-8)
    assert np.linalg.norm(frames[-1].tool.centre - way[-1]) > 1e-5


def test_compliant_tool_pushes_like_a_stiff_one_at_its_true_position():
    frames = replay(_compliant(60.0), POKE, GRID)
    stiff = replay(SETUP, np.array([frame.tool.centre for frame in frames]), GRID)
    for soft, hard in zip(frames, stiff, strict=True):
        assert soft.displacement == pytest.approx(hard.displacement, abs=1e-7)
        assert soft.force == pytest.approx(hard.force, rel=1e-4, abs=1e-6)


def test_tool_on_a_very_soft_spring_barely_dents_the_block():
    frame = replay(_compliant(1e3), POKE, GRID)[-1]
    assert frame.outcome is Outcome.CONVERGED
    assert 0 < -frame.displacement[:, 2].min() < 1.2e-3


def test_missing_balance_is_reported(monkeypatch):
    monkeypatch.setattr("palpate.replay.compliance_and_slip._MOST_PLACES", 1)
    frame = replay(_compliant(60.0), POKE[:2], GRID)[-1]
    assert frame.outcome is Outcome.TOOL_SWINGS and "spring" in frame.outcome.value
    with pytest.raises(SolveError, match="frame 0: the tool's mount is so compliant"):
        require_converged([frame])


def test_compliance_works_with_gravity_and_a_slipping_base():
    setup = _compliant(
        30.0,
        replace(
            SETUP,
            load=Load(specific_weight_over_stiffness=1.0),
            support=Support(friction_coefficient=0.1),
        ),
    )
    frames = replay(setup, SIDE, GRID)
    require_converged(frames)
    assert np.linalg.norm(frames[-1].slip) > 1e-4
    wanted = SIDE[-1] + 30.0 / setup.material.young_modulus * frames[-1].force
    assert frames[-1].tool.centre == pytest.approx(wanted, abs=1e-6)
