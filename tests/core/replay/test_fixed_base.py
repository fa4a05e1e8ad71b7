"""Pushes so deep that a coarse grid or a soft penalty would let the tool penetrate."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.model import BlockModel
from palpate.fem.newton import Outcome, relative_residual
from palpate.gradients.displacement_changes import displacement_changes
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import Equilibrium, Replay, replay, require_converged
from palpate.setup.setup import Box, Material, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
HARD_PRESS = Setup(
    geometry=Box(size=SIZE),
    tool=Tool(radius=6e-3),
    material=Material(poisson_ratio=0.48, stretch_limit=1.5),
)
PRESS = np.array([[0.0, 0.0, SIZE[2] + 6e-3 - depth] for depth in (3e-3, 6e-3, 9e-3, 11e-3)])
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)


@pytest.fixture(scope="module")
def pressed() -> list[Equilibrium]:
    return replay(HARD_PRESS, PRESS, GRID)


def test_contact_hardens_if_penetration_is_too_large(pressed):
    require_converged(pressed)
    assert pressed[0].hardness == 1.0 and pressed[-1].hardness > 1.0
    assert max(frame.penetration for frame in pressed) <= 2e-4


def test_hardened_frame_has_the_sensitivity_of_solves(pressed):
    wider = Setup(
        geometry=HARD_PRESS.geometry, tool=Tool(radius=6.001e-3), material=HARD_PRESS.material
    )
    block, other = Replay(HARD_PRESS, GRID, tolerance=1e-8), Replay(wider, GRID, tolerance=1e-8)
    frame = block.step(PRESS[3], pressed[3])
    solved = other.step(PRESS[3], frame)
    assert frame.hardness == solved.hardness > 1.0
    wanted = solved.displacement - frame.displacement
    found = displacement_changes(block, frame, [(wider, np.zeros(3))])[0]
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


@pytest.fixture(scope="module")
def beside() -> list[Equilibrium]:
    """A small ball pressed into the side of a coarse block by more than its radius."""
    material = Material(poisson_ratio=0.322, stretch_limit=26.7, log_ratio=0.7)
    setup = Setup(geometry=Box(size=SIZE), tool=Tool(radius=4.27e-3), material=material)
    way = 1e-3 * np.array(
        [
            [-7.06, 21.09, 20.75],
            [-6.88, 17.66, 20.85],
            [-6.8, 16.1, 20.9],
            [-6.72, 14.57, 20.95],
            [-6.66, 13.42, 20.98],
        ]
    )
    return replay(setup, way, GridSpec(nodes=(9, 7, 5), spacing=2e-3, order=2))


def test_small_ball_switches_to_dense_contact_points(beside):
    require_converged(beside)
    assert not beside[0].dense and beside[-1].dense
    assert beside[-1].force[1] > beside[-2].force[1] > 0


def test_dense_frame_is_in_equilibrium_in_the_dense_model(beside):
    frame = beside[-1]
    setup = Setup(
        geometry=Box(size=SIZE),
        tool=Tool(radius=4.27e-3),
        material=Material(poisson_ratio=0.322, stretch_limit=26.7, log_ratio=0.7),
    )
    residuals = []
    for dense in (True, False):
        model, positions = (
            BlockModel(setup, frame.mesh, dense=dense),
            frame.mesh.nodes + frame.displacement,
        )
        model.harden(frame.hardness)
        model.restrict_to_facing(positions, (frame.tool,))
        residuals.append(
            relative_residual(model, model.assemble(positions, frame.tool, tangent=False))
        )
    assert residuals[0] < 1e-5 < residuals[1]


def test_tool_in_the_fixed_base_is_reported_and_the_next_frame_solved():
    """The ball pushes a side so low that it would have to move the bottom's edge."""
    aside = SIZE[0] / 2 + HARD_PRESS.tool.radius
    way = np.array(
        [[aside - 1e-3, 0.0, 8e-3], [aside - 4e-3, 0.0, 2e-3], [aside - 1e-3, 0.0, 8e-3]]
    )
    frames = replay(HARD_PRESS, way, GRID)
    assert [frame.outcome for frame in frames] == [
        Outcome.CONVERGED,
        Outcome.BASE_IN_TOOL,
        Outcome.CONVERGED,
    ]
    assert frames[1].penetration == pytest.approx(6e-3 - np.hypot(2e-3, 2e-3), abs=1e-6)
    assert np.abs(frames[2].displacement - frames[0].displacement).max() < 1e-5


def test_movable_base_has_no_fixed_edge():
    giving = replace(HARD_PRESS, support=Support(stiffness_over_E=1e2))
    frame = Replay(giving, GRID).step(np.array([SIZE[0] / 2 + 5.8e-3, 0.0, 1e-3]))
    assert frame.outcome is Outcome.CONVERGED
