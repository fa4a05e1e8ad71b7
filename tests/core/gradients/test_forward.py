from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pushed_block import GRID, SETUP, SIZE, poke

from palpate.fem.constitutive.elastic import elastic_energy
from palpate.fem.constitutive.stiffness_field import lump_share
from palpate.fem.mesh_quadrature import element_quadrature
from palpate.fem.model import BlockModel
from palpate.fem.newton import solve
from palpate.foundation.arrays import FloatArray
from palpate.gradients.displacement_changes import displacement_changes
from palpate.gradients.frame_tangent import factorise_at
from palpate.gradients.setup_change import TOOL_STEP
from palpate.gradients.stiffness_derivatives import point_forces, stiffness_changes
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Inclusion, Load, Sensor, Setup, Support

TIGHT = 1e-10
SMALL = 1e-3


@pytest.fixture(scope="module")
def pushed() -> tuple[Replay, Equilibrium]:
    """A ball pressed in by 4 mm, solved to the last digits."""
    block = Replay(SETUP, GRID, TIGHT)
    return block, block.step(poke(4e-3), block.step(poke(2e-3)))


def _relative(found: FloatArray, wanted: FloatArray) -> float:
    assert np.linalg.norm(wanted) > 0
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


def _stiffened(frame: Equilibrium, log_factor: FloatArray) -> FloatArray:
    """Displacement (n, 3) [m] when the points' stiffness is multiplied, by a full solve."""
    model = BlockModel(SETUP, frame.mesh)
    model.mu, model.bulk = model.mu * np.exp(log_factor), model.bulk * np.exp(log_factor)
    solution = solve(model, frame.tool, frame.mesh.nodes + frame.displacement, None, TIGHT)
    assert solution.converged
    return solution.positions - frame.mesh.nodes


def test_stiffness_changes_are_those_of_full_solves(pushed):
    block, frame = pushed
    rule = element_quadrature(frame.mesh)
    alone = np.zeros(rule.weights.shape)
    alone.flat[np.argmin(np.linalg.norm(rule.places - poke(14e-3), axis=2))] = 1.0
    lump = lump_share(Inclusion(x=8e-3, y=0.0, z=0.022, radius=7e-3, stiffness_ratio=math.e), rule)
    field = np.asarray(np.random.default_rng(0).standard_normal(rule.weights.shape))
    found = stiffness_changes(block, frame, np.array([alone, lump, field]))
    for factor, change in zip((alone, lump, field), found, strict=True):
        wanted = (_stiffened(frame, SMALL * factor) - _stiffened(frame, -SMALL * factor)) / (
            2 * SMALL
        )
        assert _relative(change, wanted) < 0.01


def test_stiffness_everywhere_the_same_moves_only_against_the_contact(pushed):
    block, frame = pushed
    whole = stiffness_changes(
        block, frame, np.ones((1, *element_quadrature(frame.mesh).weights.shape))
    )[0]
    # Position-driven: a stiffer block takes the same shape, but for the softness of the contact.
    assert np.abs(whole).max() < 0.05 * np.abs(frame.displacement).max()


@pytest.mark.parametrize("compliance", [0.0, 30.0], ids=["stiff tool", "tool that gives way"])
def test_lump_of_the_setup_is_what_its_column_says(compliance):
    stated = replace(SETUP, tool=replace(SETUP.tool, compliance_times_stiffness=compliance))
    block = Replay(stated, GRID, TIGHT)
    frame = block.step(poke(4e-3), block.step(poke(2e-3)))
    lump = Inclusion(x=8e-3, y=0.0, z=0.022, radius=7e-3, stiffness_ratio=math.e)
    found = stiffness_changes(block, frame, lump_share(lump, element_quadrature(frame.mesh))[None])[
        0
    ]
    setups = [
        replace(
            stated,
            material=replace(
                SETUP.material, inclusions=(replace(lump, stiffness_ratio=np.exp(step)),)
            ),
        )
        for step in (SMALL, -SMALL)
    ]
    stiffer, softer = (
        Replay(setup, GRID, TIGHT).step(poke(4e-3), frame).displacement for setup in setups
    )
    assert _relative(found, (stiffer - softer) / (2 * SMALL)) < 0.01


def test_point_forces_are_gradients_of_each_points_energy(pushed):
    block, frame = pushed
    model = block.model(frame.mesh)
    positions = frame.mesh.nodes + frame.displacement
    forces = point_forces(model, positions)
    random = np.random.default_rng(1)
    for element, point in random.integers(model.mu.shape, size=(5, 2)):
        only = slice(element, element + 1)
        parts = ("slopes", "weights", "pressures", "places")
        rule = replace(model.rule, **{name: getattr(model.rule, name)[only] for name in parts})
        alone = np.arange(model.mu.shape[1]) == point
        nodes, mu, bulk = (
            model.topology.elements[only],
            model.mu[only] * alone,
            model.bulk[only] * alone,
        )
        energy = partial(elastic_energy, model.law, rule, nodes, mu, bulk)

        for corner, axis in ((0, 2), (5, 0), (7, 1)):
            step = np.zeros_like(positions)
            step[model.topology.elements[element, corner], axis] = 1e-7
            wanted = (energy(positions + step) - energy(positions - step)) / 2e-7
            assert forces[element, point, corner, axis] == pytest.approx(
                wanted, rel=1e-3, abs=1e-5 * np.abs(forces).max()
            )


def test_point_forces_add_up_to_the_residual_and_balance(pushed):
    block, frame = pushed
    model = block.model(frame.mesh)
    positions = frame.mesh.nodes + frame.displacement
    forces = point_forces(model, positions)
    total = np.zeros_like(positions)
    np.add.at(total, model.topology.elements, forces.sum(axis=1))
    assert np.allclose(
        total[model.topology.free], model.assemble(positions, None).residual, atol=1e-16
    )
    assert np.abs(forces.sum(axis=2)).max() < 1e-9 * np.abs(forces).max()


def test_tool_motion_is_that_of_full_solves(pushed):
    block, frame = pushed
    found = (
        displacement_changes(block, frame, [(SETUP, TOOL_STEP * axis) for axis in np.eye(3)])
        / TOOL_STEP
    )
    for axis, change in zip(np.eye(3), found, strict=True):
        ahead, behind = (
            block.step(poke(4e-3) + sign * 1e-6 * axis, frame).displacement for sign in (1, -1)
        )
        assert _relative(change, (ahead - behind) / 2e-6) < 0.02


def test_sensor_alone_moves_nothing(pushed):
    block, frame = pushed
    late = replace(SETUP, sensor=Sensor(time_offset=0.1))
    assert not displacement_changes(block, frame, [(late, np.zeros(3))]).any()


def test_changes_are_linear_in_the_step(pushed):
    block, frame = pushed

    def softer(change: float) -> Setup:
        return replace(SETUP, material=replace(SETUP.material, poisson_ratio=0.45 + change))

    one, two = displacement_changes(
        block, frame, [(softer(1e-4), np.zeros(3)), (softer(2e-4), np.zeros(3))]
    )
    assert _relative(two, 2 * one) < 5e-3


def test_tangent_at_a_frame_is_made_once_until_another_takes_its_place(monkeypatch, pushed):
    block, frame = pushed
    steps = [(block.setup, TOOL_STEP * np.array([0.0, 0.0, 1.0]))]
    tangents, assemble = [], BlockModel.assemble

    def counted(self, positions, tool, *, tangent=True, bending=True):
        tangents.append(tangent)
        return assemble(self, positions, tool, tangent=tangent, bending=bending)

    monkeypatch.setattr(BlockModel, "assemble", counted)
    block.factorised = None
    first = displacement_changes(block, frame, steps)
    assert sum(tangents) == 1
    again = displacement_changes(block, frame, steps)
    assert sum(tangents) == 1 and np.array_equal(first, again)
    other = block.step(poke(3e-3), frame)
    made = sum(tangents)
    assert made > 1
    assert np.allclose(displacement_changes(block, frame, steps), first, rtol=1e-8, atol=1e-15)
    assert sum(tangents) == made + 1
    elsewhere = displacement_changes(block, other, steps)
    assert sum(tangents) == made + 2 and not np.allclose(elsewhere, first, rtol=1e-3)


def test_untouched_block_answers_to_weight_only():
    block = Replay(SETUP, GRID)
    frame = block.step(poke(-9e-3))
    assert not displacement_changes(block, frame, [(SETUP, np.array([0.0, 0.0, TOOL_STEP]))]).any()
    assert not stiffness_changes(
        block, frame, np.ones((2, *element_quadrature(frame.mesh).weights.shape))
    ).any()
    sagging = Replay(replace(SETUP, load=Load(specific_weight_over_stiffness=1.5)), GRID)
    heavier = replace(SETUP, load=Load(specific_weight_over_stiffness=1.501))
    assert (
        displacement_changes(sagging, sagging.step(poke(-9e-3)), [(heavier, np.zeros(3))])[
            0, :, 2
        ].min()
        < 0
    )


def test_no_changes_ask_for_no_solve(pushed):
    block, frame = pushed
    assert displacement_changes(block, frame, []).shape == (0, *frame.displacement.shape)
    assert factorise_at(block, frame) is not None


def test_base_that_slid_stays_where_it_is_in_the_changes_of_one_frame():
    """Where it would have slid to instead hangs on the frames before: that is for `core.adjoint` to
    tell.
    """
    loose = replace(SETUP, support=Support(friction_coefficient=0.1))
    softer = replace(loose, material=replace(loose.material, poisson_ratio=0.451))
    block, frame = Replay(loose, GRID, TIGHT), None
    for depth in (1e-3, 2e-3, 3e-3, 4e-3):
        frame = block.step(np.array([-SIZE[0] / 2 - 5e-3 + depth, 1e-3, 0.02]), frame)
    assert frame is not None and frame.slip[0] > 5e-4
    other = Replay(softer, GRID, TIGHT)
    other.slip = frame.slip.copy()
    wanted = other.solve_with_fixed_base(frame.tool, frame).displacement - frame.displacement
    assert _relative(displacement_changes(block, frame, [(softer, np.zeros(3))])[0], wanted) < 0.02
    slippery = replace(loose, support=Support(friction_coefficient=0.099))
    assert not displacement_changes(block, frame, [(slippery, np.zeros(3))]).any()
