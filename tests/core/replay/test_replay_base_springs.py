"""A block on springs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import Equilibrium, Replay, replay, require_converged, rest
from palpate.setup.setup import Box, Load, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3), mass=0.104)
GRIDS = pytest.mark.parametrize(
    "grid",
    [GridSpec(nodes=(9, 7, 6)), GridSpec(nodes=(9, 7, 5), order=2)],
    ids=["trilinear", "quadratic"],
)
POKE = np.array([[5e-3, 2e-3, SIZE[2] + 5e-3 - depth] for depth in (1e-3, 3e-3, 5e-3)])


def _on_springs(stiffness: float) -> Setup:
    return replace(SETUP, support=Support(stiffness_over_E=stiffness))


def _pull(frame: Equilibrium, setup: Setup, grid: GridSpec) -> FloatArray:
    """Force of the springs on the block over E (3,) [m^2]."""
    model = Replay(setup, grid).model(frame.mesh)
    return model._bond_gradient(frame.mesh.nodes + frame.displacement).sum(axis=(0, 1))


@GRIDS
def test_springs_settle_by_the_weight_over_their_stiffness(grid):
    setup = replace(_on_springs(100.0), load=Load(specific_weight_over_stiffness=1.5))
    frame = rest(setup, grid)
    places = [np.linspace(-size / 2, size / 2, 2 * 240 + 1)[1::2] for size in SIZE[:2]]
    base = np.array([[x, y, 0.0] for x in places[0][::4] for y in places[1][::4]])
    settled = (frame.move(base) - base).mean(axis=0)
    assert _pull(frame, setup, grid) == pytest.approx(
        [0.0, 0.0, -1.5 * np.prod(SIZE)], rel=1e-5, abs=1e-9
    )
    assert settled == pytest.approx([0.0, 0.0, -1.5 * SIZE[2] / 100.0], rel=0.02, abs=2e-5)


@GRIDS
def test_springs_carry_the_tools_push(grid):
    setup = _on_springs(60.0)
    frames = replay(setup, POKE, grid)
    require_converged(frames)
    for frame in frames:
        push = -frame.force / setup.material.young_modulus
        assert _pull(frame, setup, grid) == pytest.approx(
            push, rel=1e-3, abs=1e-4 * float(np.linalg.norm(push))
        )


@GRIDS
def test_stiffer_springs_are_nearer_to_a_fixed_base(grid):
    held = replay(SETUP, POKE, grid)[-1].displacement
    frames = (replay(_on_springs(stiffness), POKE, grid)[-1] for stiffness in (30.0, 300.0, 3000.0))
    misses = [np.linalg.norm(frame.displacement - held) for frame in frames]
    assert misses[0] > 5 * misses[1] > 25 * misses[2] > 0
