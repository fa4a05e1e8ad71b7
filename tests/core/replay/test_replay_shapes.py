"""Replays of bodies other than blocks, against hexahedra and against general properties."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from shapes import box_surface, dome

from benchmarks.reference_pokes import SETUP, compared, reference
from palpate.fem.model import BlockModel, ToolSphere
from palpate.foundation.arrays import FloatArray
from palpate.gradients.displacement_changes import displacement_changes
from palpate.mesh.tet_fill import TetSpec
from palpate.replay.mesh_convergence import mesh_errors
from palpate.replay.replay import Replay, replay, require_converged
from palpate.setup.free_form.fixed_region import Painted
from palpate.setup.setup import Detachment, Load, Material, Setup, Shape, Support, Tool

BOX = SETUP.geometry.size
RADII = (0.03, 0.022, 0.02)
DOME = Setup(geometry=dome(RADII), tool=Tool(radius=5e-3), mass=0.05)


def _down(x: float, top: float, *depths: float) -> FloatArray:
    """Tool centres (f, 3) [m] above one point of a surface of this height."""
    return np.array([[x, 0.0, top + 5e-3 - depth] for depth in depths])


def _coarse(centres: FloatArray) -> TetSpec:
    return TetSpec.along(centres, 5e-3, spacing=2.5e-3, coarsest=4e-3)


def test_block_from_a_surface_moves_and_pushes_like_the_reference():
    centres = _down(0.0, BOX[2], *np.arange(1, 9) * 1e-3)
    setup = replace(SETUP, geometry=Shape(*box_surface(BOX)))
    frames = replay(
        setup,
        centres,
        TetSpec.along(centres, 5e-3, spacing=1.5e-3, growth=0.5, coarsest=5e-3),
        tolerance=1e-5,
    )
    require_converged(frames)
    displacement, force = reference().error(compared([frames[3], frames[7]]))
    assert (displacement < (0.065, 0.07)).all()
    assert (np.abs(force) < (0.01, 0.03)).all()


@pytest.mark.parametrize("poisson_ratio", [0.45, 0.4999])
def test_nearly_incompressible_body_does_not_lock(poisson_ratio):
    """Halving the spacing must not soften a body by much: locked elements soften several times."""
    setup, centres = (
        replace(DOME, material=Material(poisson_ratio=poisson_ratio)),
        _down(0.0, RADII[2], 1e-3, 2e-3),
    )
    specs = [
        TetSpec.along(centres, 5e-3, spacing=spacing, coarsest=4e-3) for spacing in (2.5e-3, 1.5e-3)
    ]
    coarse, fine = (replay(setup, centres, spec)[-1] for spec in specs)
    assert coarse.force[2] == pytest.approx(fine.force[2], rel=0.06)


def test_organ_is_palpated_from_above_and_from_the_side():
    above, side = (
        _down(0.0, RADII[2], -1e-3, 1e-3, 2.5e-3, 4e-3),
        np.array([[RADII[0] + 5e-3 - d, 0.0, 6e-3] for d in (0.0, 4e-3)]),
    )
    centres = np.concatenate(
        [above, above[:1] + np.array([0.0, 0.0, 0.02]), side + np.array([0.02, 0.0, 0.0]), side]
    )
    frames = replay(DOME, centres, _coarse(centres))
    require_converged(frames)
    assert not frames[0].in_contact and not frames[0].displacement.any()
    assert frames[1].force[2] < frames[2].force[2] < frames[3].force[2]
    assert (
        np.linalg.norm(frames[3].force[:2]) < 0.05 * frames[3].force[2]
    )  # pressed on an axis of symmetry
    assert frames[-1].force[0] > 5 * abs(frames[-1].force[1])
    assert max(frame.penetration for frame in frames) < 4e-4
    tip = frames[3].move(np.array([[0.0, 0.0, RADII[2]]]))[0]
    assert tip[2] == pytest.approx(RADII[2] - 4e-3, abs=3e-4)
    assert all(frame.mesh is frames[0].mesh for frame in frames)


@pytest.mark.parametrize("poisson_ratio", [0.45, 0.49])
def test_push_to_two_fifths_of_the_height_converges(poisson_ratio):
    centres = _down(0.0, RADII[2], *np.arange(1, 9) * 1e-3)
    frames = replay(
        replace(DOME, material=Material(poisson_ratio=poisson_ratio)), centres, _coarse(centres)
    )
    require_converged(frames)
    assert all(later.force[2] > earlier.force[2] for earlier, later in pairwise(frames))


@pytest.mark.parametrize(
    "softer",
    [
        replace(DOME, support=Support(detached=(Detachment(edge="-x", extent=0.035),))),
        replace(DOME, support=Support(stiffness_over_E=100.0)),
        replace(DOME, support=Support(friction_coefficient=0.05)),
        replace(DOME, tool=Tool(radius=5e-3, compliance_times_stiffness=20.0)),
    ],
    ids=["detached", "springs", "slides", "compliant tool"],
)
def test_organ_that_is_held_less_resists_less(softer):
    inwards = np.array([0.6, 0.0, -0.8])  # from the left and above
    start = np.array([-0.021, 0.0, 0.0143]) - 5e-3 * inwards
    centres = start + np.outer([1e-3, 2e-3, 3e-3], inwards)
    frames = [replay(setup, centres, _coarse(centres)) for setup in (DOME, softer)]
    for each in frames:
        require_converged(each)
    assert np.linalg.norm(frames[1][-1].force) < 0.98 * np.linalg.norm(frames[0][-1].force)


def test_shape_does_not_depend_on_the_modulus_but_the_force_does():
    centres = _down(5e-3, 0.0195, 1e-3, 2e-3)
    one, other = (
        replay(replace(DOME, material=Material(young_modulus=modulus)), centres, _coarse(centres))[
            -1
        ]
        for modulus in (5e3, 2e4)
    )
    assert np.allclose(one.displacement, other.displacement, atol=1e-12)
    assert np.allclose(4 * one.force, other.force, rtol=1e-9)


def test_force_on_the_tool_is_the_derivative_of_the_energy():
    centres = _down(5e-3, 0.0195, 1e-3, 2e-3)
    block, spec = Replay(DOME, _coarse(centres), tolerance=1e-10), _coarse(centres)
    frame = block.step(centres[1], block.step(centres[0]))
    model, step = block.model(frame.mesh), 1e-5

    def energy(shift: FloatArray) -> float:
        near = Replay(DOME, spec, tolerance=1e-10).step(centres[1] + shift, frame)
        return model.energy(near.mesh.nodes + near.displacement, near.tool)

    for axis in (0, 2):
        shift = step * np.eye(3)[axis]
        slope = -(energy(shift) - energy(-shift)) / (2 * step) * DOME.material.young_modulus
        assert slope == pytest.approx(frame.force[axis], rel=1e-3, abs=1e-4)


def test_residual_is_the_gradient_of_the_whole_energy():
    centres = _down(0.0, RADII[2], 2e-3)
    mesh = _coarse(centres).mesh(DOME, centres[0])
    soft = replace(
        DOME, load=Load(specific_weight_over_stiffness=2.0), support=Support(stiffness_over_E=100.0)
    )
    model, tool = BlockModel(soft, mesh), ToolSphere(centres[0], 5e-3)
    random = np.random.default_rng(0)
    positions = mesh.nodes + 1e-5 * random.normal(size=mesh.nodes.shape)
    state, way = model.assemble(positions, tool), np.asarray(random.normal(size=mesh.nodes.shape))
    slope = (
        model.energy(positions + 1e-9 * way, tool) - model.energy(positions - 1e-9 * way, tool)
    ) / 2e-9
    assert state.penetration > 1e-4
    assert slope == pytest.approx(float(state.residual @ way[model.topology.free]), rel=1e-5)


def test_gradients_on_an_organ_are_those_of_finite_differences():
    centres = _down(5e-3, 0.0195, 1e-3, 2e-3)
    block, step = Replay(DOME, _coarse(centres), tolerance=1e-9), 1e-4
    frame = block.step(centres[1], block.step(centres[0]))
    near = replace(DOME, material=Material(poisson_ratio=0.45 + step))
    moved = Replay(near, _coarse(centres), tolerance=1e-9).step(centres[1], frame)
    wanted = moved.displacement - frame.displacement
    found = displacement_changes(block, frame, [(near, np.zeros(3))])[0]
    assert np.linalg.norm(found - wanted) < 0.01 * np.linalg.norm(wanted)


def test_mesh_error_of_an_organ_is_estimated():
    centres = _down(0.0, RADII[2], 1e-3, 2e-3)
    frames = replay(DOME, centres, _coarse(centres))
    (miss,) = mesh_errors(DOME, frames, _coarse(centres))
    assert miss.frame == 1 and 0.005 < miss.relative < 0.3 and miss.force < 0.1


def test_organ_held_at_a_painted_side_sags_towards_the_other():
    whole = dome(RADII)
    held = replace(
        DOME,
        geometry=dome(RADII, Painted.of(whole.vertices[:, 0] < -0.015)),
        load=Load(specific_weight_over_stiffness=2.0),
    )
    frame = Replay(held, TetSpec(path=(), radius=5e-3, spacing=4e-3, coarsest=4e-3)).free
    assert not frame.displacement[frame.mesh.connectivity.base_nodes].any()
    ends = frame.move(np.array([[0.028, 0.0, 2e-3], [-0.028, 0.0, 2e-3]]))[:, 2] - 2e-3
    assert ends[0] < -1e-3 and abs(ends[1]) < 1e-4


def test_tool_with_friction_drags_an_organ_along():
    centres = np.array([[x, 0.0, RADII[2] + 5e-3 - 2e-3] for x in (0.0, 1e-3, 2e-3)])
    rough = replace(DOME, tool=Tool(radius=5e-3, friction_coefficient=0.5))
    smooth, dragged = (replay(setup, centres, _coarse(centres)) for setup in (DOME, rough))
    require_converged(dragged)
    assert -dragged[-1].force[0] > 0.2 * dragged[-1].force[2] > -smooth[-1].force[0]
