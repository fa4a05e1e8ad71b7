"""Friction's energy, force and tangent at a fixed normal pressure; transfer of its history between
grids.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.fem.friction import STICK_STIFFNESS, FrictionHistory, FrictionPotential
from palpate.fem.model import BlockModel, ToolSphere
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.setup.setup import Box, Setup, Tool

SETUP = Setup(geometry=Box(size=(0.03, 0.03, 0.02)), tool=Tool(radius=5e-3))
TOOL = ToolSphere(np.array([1e-3, -5e-4, 0.024]), 5e-3)


def _with_friction(order: int) -> tuple[BlockModel, np.ndarray]:
    """A block with friction on its top, where some points stick and some slip, and nodes slightly
    off rest.
    """
    random = np.random.default_rng(5)
    model = BlockModel(SETUP, box_mesh(SETUP.geometry.size, GridSpec(nodes=(7, 7, 5), order=order)))
    positions = (
        model.mesh.nodes
        + 1e-4 * random.standard_normal(model.mesh.nodes.shape) * model.topology.free
    )
    faces = np.arange(6)
    seen = (
        np.einsum("qa,fai->fqi", model.face.shapes, positions[model.topology.surface[faces]])
        - TOOL.centre
    )
    normals = seen / np.linalg.norm(seen, axis=2, keepdims=True)
    areas = model.areas[faces]
    anchors = seen + 1e-4 * random.standard_normal(seen.shape)
    limits = STICK_STIFFNESS * areas * random.uniform(0, 2.5e-4, areas.shape)
    model.friction_potential = FrictionPotential(
        faces, anchors, normals, limits, STICK_STIFFNESS * areas
    )
    return model, positions


@pytest.mark.parametrize("order", [1, 2])
def test_force_and_tangent_are_derivatives_of_the_energy(order):
    model, positions = _with_friction(order)
    free, grip = model.topology.free, model.friction_potential
    assert grip is not None
    drag = grip.stiffness * 1e-4
    assert (drag > grip.limits).any() and (drag < grip.limits).any()
    direction = np.random.default_rng(2).standard_normal(positions.shape) * free
    away = ToolSphere(
        np.array([0.0, 0.0, 0.1]), 5e-3
    )  # far from the block, so that nothing but the grip feels it
    model.friction_potential = FrictionPotential(
        grip.faces,
        grip.anchors + TOOL.centre - away.centre,
        grip.normals,
        grip.limits,
        grip.stiffness,
    )
    step = 1e-8
    ahead, behind = positions + step * direction, positions - step * direction
    state = model.assemble(positions, away)
    slope = (model.energy(ahead, away) - model.energy(behind, away)) / (2 * step)
    assert slope == pytest.approx(float(state.residual @ direction[free]), rel=1e-6)
    change = (model.assemble(ahead, away).residual - model.assemble(behind, away).residual) / (
        2 * step
    )
    model.topology.factor.factorise(state.data)
    assert np.allclose(model.topology.factor.solve(change), direction[free], atol=1e-4)


def test_drag_on_the_body_is_within_the_limits_and_adds_to_the_push():
    model, positions = _with_friction(1)
    held = model.assemble(positions, TOOL)
    grip, model.friction_potential = model.friction_potential, None
    assert grip is not None
    free = model.assemble(positions, TOOL)
    drag = held.push - free.push
    assert 0 < np.linalg.norm(drag) <= grip.limits.sum()
    force = np.zeros_like(positions)
    force[model.topology.free] = (held.residual - free.residual).ravel()
    assert np.allclose(force.sum(axis=0), -drag, atol=1e-12)


def test_friction_history_is_interpolated_at_and_between_its_points():
    random = np.random.default_rng(1)
    places = np.append(random.uniform(0, 1e-2, (400, 2)), np.zeros((400, 1)), axis=1)
    touched = places[:, 0] < 5e-3
    ways = np.where(touched[:, None], 0.01 * places, 0.0)
    hold = FrictionHistory(places, ways, touched, np.where(touched, 2.0, 0.0))
    found = hold.at(places.reshape(20, 20, 3))
    assert (
        np.allclose(found.ways.reshape(-1, 3), ways, atol=1e-8)
        and (found.touched.ravel() == touched).all()
    )
    assert np.allclose(found.limits.ravel(), 2.0 * touched, atol=1e-3)
    between = hold.at(np.array([[2e-3, 4e-3, 0.0]]))
    assert np.allclose(between.ways, 0.01 * np.array([2e-3, 4e-3, 0.0]), atol=5e-6)
    nothing = FrictionHistory.nothing().at(places)
    assert not nothing.ways.any() and not nothing.touched.any() and not nothing.limits.any()
