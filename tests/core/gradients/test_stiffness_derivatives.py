"""Changes with the stiffness of parts of the body, against full solves."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from pushed_block import GRID, SETUP, poke

from palpate.fem.constitutive.elastic import elastic_energy
from palpate.fem.constitutive.stiffness_field import lump_share
from palpate.fem.mesh_quadrature import element_quadrature
from palpate.fem.model import BlockModel
from palpate.fem.newton import solve
from palpate.foundation.arrays import FloatArray
from palpate.gradients.stiffness_derivatives import point_forces, stiffness_changes
from palpate.replay.replay import Equilibrium, Replay
from palpate.setup.setup import Inclusion

TIGHT = 1e-10
SMALL = 1e-3


def _relative(found: FloatArray, wanted: FloatArray) -> float:
    assert np.linalg.norm(wanted) > 0
    return float(np.linalg.norm(found - wanted) / np.linalg.norm(wanted))


def _stiffened(frame: Equilibrium, log_factor: FloatArray) -> FloatArray:
    """Displacement (n, 3) [m] with the points' stiffness multiplied, by a full solve."""
    model = BlockModel(SETUP, frame.mesh)
    model.mu, model.bulk = model.mu * np.exp(log_factor), model.bulk * np.exp(log_factor)
    solution = solve(model, frame.tool, frame.mesh.nodes + frame.displacement, None, TIGHT)
    assert solution.converged
    return solution.positions - frame.mesh.nodes


def test_stiffness_changes_equal_full_solves(pushed):
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


@pytest.mark.parametrize("compliance", [0.0, 30.0], ids=["stiff tool", "compliant tool"])
def test_inclusion_of_the_setup_equals_its_column(compliance):
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
