from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.fem.contact import assemble_contact, contact_energy
from palpate.fem.model import CONTACT_STIFFNESS, BlockModel, ToolSphere
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.mesh.elements import HEXAHEDRA
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Detachment, Layer, Material, Setup, Support, Tool

SIZE = (0.0687, 0.0393, 0.0358)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))


def _model(setup: Setup = SETUP, nodes: tuple[int, int, int] = (9, 7, 4)) -> BlockModel:
    return BlockModel(setup, box_mesh(SIZE, GridSpec(nodes=nodes, spacing=1e-3)))


def _dented(model: BlockModel, seed: int) -> tuple[np.ndarray, ToolSphere]:
    """A slightly irregular dent in the top, and a ball 2 mm below the original top, so that some
    points lie inside it.
    """
    nodes = model.mesh.nodes
    distance = np.hypot(nodes[:, 0] - 1e-3, nodes[:, 1])
    sunk = np.zeros_like(nodes)
    sunk[:, 2] = -1.6e-3 * np.exp(-((distance / 3e-3) ** 2)) * nodes[:, 2] / SIZE[2]
    sunk += 1e-5 * np.random.default_rng(seed).normal(size=nodes.shape)
    return nodes + sunk, ToolSphere(np.array([1e-3, 0.0, SIZE[2] + 3e-3]), 5e-3)


@pytest.mark.parametrize("order", HEXAHEDRA)
def test_areas_of_the_quadrature_points_add_up_to_the_surface(order):
    areas = BlockModel(
        SETUP, box_mesh(SIZE, GridSpec(nodes=(9, 7, 5), spacing=1e-3, order=order))
    ).areas
    x, y, z = SIZE
    assert areas.sum() == pytest.approx(x * y + 2 * x * z + 2 * y * z, rel=1e-12)


def _contact_force(
    model: BlockModel, positions: np.ndarray, tool: ToolSphere
) -> tuple[np.ndarray, np.ndarray]:
    force, push = np.zeros_like(positions), np.zeros(3)
    assemble_contact(
        model.topology.surface,
        model.areas,
        model.face.shapes,
        model.face.gradients,
        positions,
        tool.centre,
        tool.radius,
        False,
        True,
        CONTACT_STIFFNESS,
        True,
        model.topology.surface_slots,
        force,
        np.empty(0),
        push,
    )
    return force, push


def test_contact_force_is_the_gradient_of_its_energy_and_pushes_back_on_the_tool():
    model = _model()
    positions, tool = _dented(model, 0)
    force, push = _contact_force(model, positions, tool)

    def energy(at: np.ndarray) -> float:
        return contact_energy(
            model.topology.surface,
            model.areas,
            model.face.shapes,
            model.face.gradients,
            at,
            tool.centre,
            tool.radius,
            False,
            True,
            CONTACT_STIFFNESS,
        )

    direction, step = np.random.default_rng(1).normal(size=positions.shape), 1e-9
    slope = (energy(positions + step * direction) - energy(positions - step * direction)) / (
        2 * step
    )
    assert energy(positions) > 0
    assert slope == pytest.approx(np.vdot(force, direction), rel=1e-6)
    assert np.allclose(force.sum(axis=0), -push, atol=1e-12 * np.abs(push).max())
    assert push[2] < 0


@pytest.mark.parametrize(
    "detached", [(), (Detachment(edge="+x", extent=0.02),)], ids=["held", "detached"]
)
def test_tangent_with_the_ball_s_curvature_is_the_derivative_of_the_residual(detached):
    model = _model(replace(SETUP, support=Support(detached=detached)))
    positions, tool = _dented(model, 2)
    free = model.topology.free
    tangent = model.topology.pattern.copy()
    tangent.data = model.assemble(positions, tool).data
    direction = np.random.default_rng(3).normal(size=free.sum())
    wanted = tangent @ direction + tangent.T @ direction - tangent.diagonal() * direction
    move, step = np.zeros_like(positions), 1e-10
    move[free] = step * direction
    ahead, behind = (model.assemble(positions + sign * move, tool).residual for sign in (1, -1))
    assert np.abs((ahead - behind) / (2 * step) - wanted).max() < 1e-5 * np.abs(wanted).max()


@pytest.mark.parametrize(
    "detached", [(), (Detachment(edge="+x", extent=0.02),)], ids=["held", "detached"]
)
def test_residual_of_the_whole_block_is_the_gradient_of_its_energy(detached):
    setup = replace(
        SETUP,
        support=Support(detached=detached),
        load=replace(SETUP.load, specific_weight_over_stiffness=2.0),
    )
    model = _model(setup)
    positions, tool = _dented(model, 4)
    direction = np.random.default_rng(5).normal(size=positions.shape) * model.topology.free
    step = 1e-9
    slope = (
        model.energy(positions + step * direction, tool)
        - model.energy(positions - step * direction, tool)
    ) / (2 * step)
    assert slope == pytest.approx(
        model.assemble(positions, tool).residual @ direction[model.topology.free], rel=1e-5
    )


def test_a_surface_that_faces_away_from_the_centre_is_not_pushed():
    model = _model()
    under = ToolSphere(np.array([0.0, 0.0, SIZE[2] - 2e-3]), 5e-3)
    _, push = _contact_force(model, model.mesh.nodes, under)
    assert not push.any()
    over = ToolSphere(np.array([0.0, 0.0, SIZE[2] + 2e-3]), 5e-3)
    _, push = _contact_force(model, model.mesh.nodes, over)
    assert push[2] < 0


def test_ball_on_a_large_block_has_hertz_force():
    setup = Setup(
        geometry=Box(size=(0.08, 0.08, 0.06)),
        tool=Tool(radius=5e-3),
        material=Material(poisson_ratio=0.45),
    )
    depths = np.array([0.25e-3, 0.5e-3, 1.0e-3])
    centres = np.stack([np.zeros(3), np.zeros(3), 0.06 + 5e-3 - depths], axis=1)
    frames = replay(setup, centres, GridSpec(nodes=(19, 19, 14), spacing=3.5e-4))
    theory = 4 / 3 * 5e3 / (1 - 0.45**2) * np.sqrt(5e-3) * depths**1.5
    ratio = np.array([frame.force[2] for frame in frames]) / theory
    assert (ratio[1:] > 0.95).all() and (ratio[1:] < 1.10).all(), ratio


@pytest.mark.parametrize("skin", [0.1, 30.0])
def test_penetration_is_as_small_with_a_hard_or_soft_skin(skin):
    way = np.array([[0.0, 0.0, SIZE[2] + 5e-3 - depth] for depth in (1e-3, 2e-3, 3e-3)])
    coated = replace(SETUP, material=Material(layer=Layer(thickness=4e-3, stiffness_ratio=skin)))
    grid = GridSpec(nodes=(9, 7, 6), spacing=1.5e-3)
    plain, inside = (replay(setup, way, grid)[-1] for setup in (SETUP, coated))
    assert abs(inside.force[2] / plain.force[2] - 1) > 0.5
    assert inside.penetration < 1.5 * plain.penetration
