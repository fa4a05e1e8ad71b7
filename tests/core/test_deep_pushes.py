"""Pushes so deep that a coarse grid or a soft penalty would let the tool in."""

from __future__ import annotations

import numpy as np
import pytest

from core.fem.newton import Outcome
from core.mesh import GridSpec
from core.replay import Equilibrium, Replay, replay, require_converged
from core.sensitivity import displacement_changes
from core.setup import Box, Material, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
HARD_PRESS = Setup(geometry=Box(size=SIZE), tool=Tool(radius=6e-3), material=Material(poisson_ratio=0.48, stretch_limit=1.5))
PRESS = np.array([[0.0, 0.0, SIZE[2] + 6e-3 - depth] for depth in (3e-3, 6e-3, 9e-3, 11e-3)])
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)


@pytest.fixture(scope="module")
def pressed() -> list[Equilibrium]:
    return replay(HARD_PRESS, PRESS, GRID)


def test_contact_hardens_where_its_penalty_gives_way(pressed):
    require_converged(pressed)
    assert pressed[0].hardness == 1.0 and pressed[-1].hardness > 1.0
    assert max(frame.penetration for frame in pressed) <= 2e-4


def test_hardened_frame_has_the_sensitivity_of_solves(pressed):
    wider = Setup(geometry=HARD_PRESS.geometry, tool=Tool(radius=6.001e-3), material=HARD_PRESS.material)
    block, other = Replay(HARD_PRESS, GRID, tolerance=1e-8), Replay(wider, GRID, tolerance=1e-8)
    frame = block.step(PRESS[3], pressed[3])
    solved = other.step(PRESS[3], frame)
    assert frame.hardness == solved.hardness > 1.0
    wanted = solved.displacement - frame.displacement
    found = displacement_changes(block, frame, [(wider, np.zeros(3))])[0]
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


def test_ball_that_slips_behind_a_coarse_surface_is_held_by_a_finer_one():
    material = Material(poisson_ratio=0.322, stretch_limit=26.7, log_ratio=0.7)
    setup = Setup(geometry=Box(size=SIZE), tool=Tool(radius=4.27e-3), material=material)
    way = 1e-3 * np.array(
        [[-7.06, 21.09, 20.75], [-6.88, 17.66, 20.85], [-6.8, 16.1, 20.9], [-6.72, 14.57, 20.95], [-6.66, 13.42, 20.98]]
    )
    grid = GridSpec(nodes=(9, 7, 5), spacing=2e-3, order=2)
    block, frame = Replay(setup, grid), None
    for centre in way:
        frame = block.step(centre, frame)
    assert frame is not None and frame.outcome is not Outcome.CONVERGED
    frames = replay(setup, way, grid)
    require_converged(frames)
    assert len(frames[0].mesh.nodes) == np.prod(grid.nodes) and len(frames[-1].mesh.nodes) == np.prod(grid.finer().nodes)
    assert frames[-1].force[1] > frames[-2].force[1] > 0
