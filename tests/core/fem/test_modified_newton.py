from __future__ import annotations

import numpy as np
import pytest

from palpate.fem.contact_condensation import CondensedContact
from palpate.fem.model import Assembly, BlockModel, ToolSphere
from palpate.fem.modified_newton import ModifiedNewton
from palpate.fem.newton import relative_residual, solve
from palpate.foundation.arrays import FloatArray
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.elements import HEXAHEDRA
from palpate.mesh.graded_mesh import REPLAY_GRID
from palpate.replay.replay import Replay
from palpate.setup.setup import Box, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
PLACE = np.array([4e-3, 2e-3, SIZE[2] + 5e-3 - 3e-3])
ORDERS = pytest.mark.parametrize("order", HEXAHEDRA)


def _pressed(order: int) -> tuple[BlockModel, FloatArray, ToolSphere]:
    """A block at rest under a tool 3 mm deep: model, positions (n, 3) [m] and tool."""
    block = Replay(SETUP, GridSpec(nodes=(9, 9, 5), spacing=2e-3, order=order), 1e-10)
    frame = block.step(PLACE)
    assert frame.outcome.name == "CONVERGED"
    return block.model(frame.mesh), frame.mesh.nodes + frame.displacement, frame.tool


def _residual(model: BlockModel, positions: FloatArray, tool: ToolSphere) -> Assembly:
    return model.assemble(positions, tool, tangent=False)


def _moved(model: BlockModel, positions: FloatArray, step: FloatArray | None) -> FloatArray:
    assert step is not None
    moved = positions.copy()
    moved[model.topology.free] += step
    return moved


@ORDERS
@pytest.mark.parametrize(
    "motion", [(0, 0, -2e-4), (3e-4, 0, 0), (0, -2e-4, 4e-4)], ids=["deeper", "along", "back"]
)
def test_modified_newton_finds_newtons_equilibrium(order, motion):
    model, positions, tool = _pressed(order)
    moved = ToolSphere(tool.centre + motion, tool.radius)
    found, wanted = (
        ModifiedNewton().solve(model, moved, positions, _residual(model, positions, moved), 1e-9),
        solve(model, moved, positions, tool, 1e-9),
    )
    assert found is not None
    assert found.converged and wanted.converged
    travelled = np.abs(wanted.positions - positions).max()
    assert np.abs(found.positions - wanted.positions).max() < 1e-6 * travelled
    assert np.allclose(found.push, wanted.push, rtol=1e-6)


@ORDERS
def test_one_step_balances_the_contact(order):
    model, positions, tool = _pressed(order)
    condensed = CondensedContact.at(model, positions, tool)
    assert condensed is not None
    moved = ToolSphere(tool.centre - (0, 0, 5e-5), tool.radius)
    before = model.assemble(positions, moved, tangent=False)
    stepped = _moved(model, positions, condensed.step(model, positions, before.residual, moved))
    after = model.assemble(stepped, moved, tangent=False)
    assert relative_residual(model, after) < 2e-3 * relative_residual(model, before)


def test_body_in_equilibrium_stays_where_it_is():
    model, positions, tool = _pressed(1)
    condensed = CondensedContact.at(model, positions, tool)
    assert condensed is not None
    residual = model.assemble(positions, tool, tangent=False).residual
    stepped = _moved(model, positions, condensed.step(model, positions, residual, tool))
    assert np.abs(stepped - positions).max() < 1e-9


def test_linearisation_is_invalid_without_its_factor():
    model, positions, tool = _pressed(1)
    condensed = CondensedContact.at(model, positions, tool)
    assert condensed is not None and condensed.fits(model)
    again = CondensedContact.at(model, positions, tool)
    assert again is not None and again.fits(model)
    assert not condensed.fits(model)


@pytest.mark.parametrize(
    "place", [PLACE, np.array([SIZE[0] / 2 + 5e-3 - 2e-3, 4e-3, 0.02])], ids=["top", "side"]
)
def test_condensed_nodes_are_near_the_focus_of_the_graded_mesh(place):
    block = Replay(SETUP, REPLAY_GRID, 1e-6)
    frame = block.step(place)
    condensed = CondensedContact.at(
        block.model(frame.mesh), frame.mesh.nodes + frame.displacement, frame.tool
    )
    assert frame.in_contact and condensed is not None
    assert np.array_equal(np.sort(condensed._nodes), frame.mesh.near_focus)
    assert len(frame.mesh.near_focus) < 0.1 * len(frame.mesh.nodes)
    assert not len(GridSpec(nodes=(9, 9, 5), order=2).mesh(SETUP, place).near_focus)


def test_kept_nodes_away_from_a_focus_hold_all_near_the_tool_and_seldom_change():
    block = Replay(SETUP, GridSpec(nodes=(13, 9, 7), order=2), 1e-6)
    frame = block.step(PLACE)
    model, positions = block.model(frame.mesh), frame.mesh.nodes + frame.displacement
    assert frame.in_contact and not len(frame.mesh.near_focus)
    kept = []
    for aside in (0.0, 1e-4, -1e-4):
        tool = ToolSphere(frame.tool.centre + aside * np.array([1.0, 1.0, 0.0]), frame.tool.radius)
        condensed = CondensedContact.at(model, positions, tool)
        assert condensed is not None
        kept.append(np.sort(condensed._nodes))
        surface = np.unique(model.topology.surface)
        close = np.linalg.norm(positions[surface] - tool.centre, axis=1) < tool.radius + 5e-4
        assert np.isin(surface[close], kept[-1]).all() and len(kept[-1]) < len(surface) / 2
    assert all(np.array_equal(one, kept[0]) for one in kept)


def test_distant_tool_has_no_linearisation():
    model, positions, _ = _pressed(1)
    far = ToolSphere(np.array([0.0, 0.0, 0.2]), 5e-3)
    assert CondensedContact.at(model, positions, far) is None
    state = _residual(model, positions, far)
    assert ModifiedNewton().solve(model, far, positions, state, 1e-9) is None


def test_many_small_steps_need_few_factors():
    model, positions, tool = _pressed(1)
    quick_solver, work = ModifiedNewton(), list[float]()
    model.spend = work.append
    for number in range(1, 21):
        moved = ToolSphere(tool.centre - (0, 0, 3e-5 * number), tool.radius)
        state = _residual(model, positions, moved)
        solution = quick_solver.solve(model, moved, positions, state, 1e-6)
        assert solution is not None and solution.converged
        positions = solution.positions
    assert work.count(1.0) <= 4
