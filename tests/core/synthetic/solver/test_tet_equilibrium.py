"""The virtual block against closed forms and against itself on finer grids."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator

from palpate.foundation.arrays import FloatArray
from palpate.synthetic.solver.mooney_rivlin import constants, solid_energy
from palpate.synthetic.solver.solid_model import SolidModel
from palpate.synthetic.solver.tet_block import TetBlock, TetGrading, mesh_block
from palpate.synthetic.solver.tet_equilibrium import TetSolver, TetState

SIZE = (0.0687, 0.0393, 0.0358)
TOP = np.array([0.0, 0.0, SIZE[2]])
RADIUS = 5e-3
MODULUS = 5e3


def _block(fine: float = 2.6e-3) -> TetBlock:
    return mesh_block(SIZE, TetGrading(TOP[None], np.array([0.8 * RADIUS]), np.array([fine])))


def _solid(
    block: TetBlock, modulus: float = MODULUS, nu: float = 0.45, weight: float = 0.0
) -> SolidModel:
    held = block.nodes[:, 2] < 1e-9
    return SolidModel(np.full(block.weights.shape, modulus), nu, weight, held, RADIUS, lifts=False)


def _poke(solver: TetSolver, depths: tuple[float, ...]) -> list[TetState]:
    states = [solver.rest]
    for depth in depths:
        states.append(solver.state(TOP + np.array([0.0, 0.0, RADIUS - depth]), states[-1]))
    return states[1:]


@dataclass(frozen=True)
class Poked:
    """A block at 1, 2, ... 6 mm depth."""

    block: TetBlock
    states: list[TetState]


@pytest.fixture(scope="module")
def poked() -> Iterator[Poked]:
    block = _block()
    solver = TetSolver(block, _solid(block))
    yield Poked(block, _poke(solver, tuple(np.arange(1, 7) * 1e-3)))
    solver.close()


def _on_top(block: TetBlock, displacement: FloatArray) -> FloatArray:
    """Displacement (12, 3) at places on the top that every grid can be asked for."""
    top = np.abs(block.surface_rest[:, 2] - SIZE[2]) < 1e-9
    x, y = np.meshgrid([-0.025, -0.012, 0.009, 0.02], [-0.012, 0.003, 0.015])
    moved = (block.surface @ displacement)[top]
    places, first = np.unique(block.surface_rest[top][:, :2].round(9), axis=0, return_index=True)
    return np.asarray(
        LinearNDInterpolator(places, moved[first])(np.stack([x.ravel(), y.ravel()], axis=1))
    )


def test_stretched_block_stores_the_energy_of_hookes_law_at_small_strain() -> None:
    block = _block(8e-3)
    strain = 1e-4
    nu = 0.45
    u = block.nodes * (-nu * strain, -nu * strain, strain)
    c10, c01, lame = constants(np.full(block.weights.shape, MODULUS), nu)
    energy = solid_energy(
        u, block.elements, block.gradients, block.weights, c10, c01, lame.mean(axis=1)
    )
    assert energy == pytest.approx(0.5 * MODULUS * strain**2 * np.prod(SIZE), rel=2e-3)


def test_shallow_poke_agrees_with_hertz() -> None:
    block = mesh_block(SIZE, TetGrading(TOP[None], np.array([3e-3]), np.array([1.4e-3])))
    solver = TetSolver(block, _solid(block))
    (state,) = _poke(solver, (0.5e-3,))
    solver.close()
    hertz = 4 / 3 * MODULUS / (1 - 0.45**2) * np.sqrt(RADIUS) * 0.5e-3**1.5
    assert -state.tool_force[2] == pytest.approx(hertz, rel=0.06)


def test_finer_grid_changes_the_top_by_less_than_three_percent(poked: Poked) -> None:
    fine = _block(1.7e-3)
    solver = TetSolver(fine, _solid(fine))
    (_, _, _, finer) = _poke(solver, (1e-3, 2e-3, 3e-3, 4e-3))
    solver.close()
    coarse = _on_top(poked.block, poked.states[3].displacement)
    exact = _on_top(fine, finer.displacement)
    assert np.linalg.norm(coarse - exact) < 0.03 * np.linalg.norm(exact)
    assert poked.states[3].tool_force[2] == pytest.approx(finer.tool_force[2], rel=0.02)


def test_work_of_the_tool_becomes_stored_energy(poked: Poked) -> None:
    block = poked.block
    c10, c01, lame = constants(np.full(block.weights.shape, MODULUS), 0.45)
    stored = solid_energy(
        poked.states[-1].displacement,
        block.elements,
        block.gradients,
        block.weights,
        c10,
        c01,
        lame.mean(axis=1),
    )
    forces = np.array([0.0, *(-state.tool_force[2] for state in poked.states)])
    assert stored == pytest.approx(np.trapezoid(forces, dx=1e-3), rel=0.05)


def test_sphere_enters_the_block_by_less_than_a_tenth_of_a_millimetre(poked: Poked) -> None:
    assert max(state.penetration for state in poked.states) < 0.1e-3


def test_push_follows_from_its_own_derivative(poked: Poked) -> None:
    before, middle, after = poked.states[2:5]
    slope = (after.tool_force[2] - before.tool_force[2]) / (after.centre[2] - before.centre[2])
    assert middle.contact_stiffness[2, 2] == pytest.approx(slope, rel=0.05)


def test_shape_does_not_depend_on_the_modulus(poked: Poked) -> None:
    solver = TetSolver(poked.block, _solid(poked.block, modulus=300.0))
    (state,) = _poke(solver, (1e-3,))
    solver.close()
    assert np.allclose(state.displacement, poked.states[0].displacement, atol=2e-6)


def test_sag_lies_between_the_confined_and_the_free_column() -> None:
    block = _block(8e-3)
    weight = 2.11 * MODULUS
    solver = TetSolver(block, _solid(block, weight=weight))
    solver.close()
    middle = np.argmin(np.linalg.norm(block.nodes - TOP, axis=1))
    assert 0.42e-3 < -solver.rest.displacement[middle, 2] < 1.35e-3


def test_nearly_incompressible_block_does_not_lock() -> None:
    forces = []
    for fine in (3.2e-3, 1.9e-3):
        block = _block(fine)
        solver = TetSolver(block, _solid(block, nu=0.49))
        forces.append(_poke(solver, (1e-3, 2e-3, 3e-3))[-1].tool_force[2])
        solver.close()
    assert forces[0] == pytest.approx(forces[1], rel=0.03)
