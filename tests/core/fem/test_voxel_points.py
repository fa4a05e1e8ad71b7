"""State of a material with history in a free form whose mesh changes from push to push."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from shapes import dome

from palpate.effects.geometry import GeometryScale
from palpate.fem.history.voxel_points import VoxelPoints
from palpate.fem.mesh_quadrature import element_quadrature
from palpate.foundation.arrays import FloatArray
from palpate.mesh.push_meshes import SCREEN_PUSHES
from palpate.mesh.tet_fill import TetSpec
from palpate.replay.replay import replay, require_converged
from palpate.setup.setup import Material, Relaxation, Setup, Tool

SETUP = Setup(
    geometry=dome((0.03, 0.022, 0.02)),
    tool=Tool(radius=5e-3),
    material=Material(relaxation=(Relaxation(fraction=0.6, time_constant=2.0),)),
    mass=0.05,
)
SHEAR = np.array([[1.1, 0.0, 0.2], [0.0, 0.9, 0.0], [0.0, 0.1, 1.0]])
PLACES = np.array([[0.0, 0.0, 0.02], [0.008, 0.0, 0.019]])
PUSHES = SCREEN_PUSHES.at(PLACES)


def down(place: FloatArray) -> FloatArray:
    """Tool centres (4, 3) [m] that press 3 mm deep above this place."""
    return place + np.array([0.0, 0.0, 5e-3]) - np.outer([-2e-3, 1e-3, 2e-3, 3e-3], [0, 0, 1])


@pytest.mark.parametrize("longer", [1.0, 1.05])
def test_affine_strain_is_exact_in_every_mesh(longer: float) -> None:
    scale = GeometryScale(scale_x=longer, scale_y=1.0, scale_z=1.0)
    setup = scale.apply(SETUP)
    points = VoxelPoints(setup, PUSHES.spacing)
    for place in PLACES:
        mesh = PUSHES.mesh(setup, place)
        tangents = points.tangents(mesh, mesh.nodes @ SHEAR.T)
        np.testing.assert_allclose(tangents, np.broadcast_to(SHEAR.T, tangents.shape), atol=1e-9)
        field = np.broadcast_to([2.0, -1.0], (len(tangents), 2))
        read = points.read(mesh, field)
        assert read.shape == (*element_quadrature(mesh).weights.shape, 2)
        np.testing.assert_allclose(read, np.broadcast_to([2.0, -1.0], read.shape), atol=1e-12)


def test_force_over_two_meshes_is_that_of_one() -> None:
    centres = np.concatenate([down(PLACES[0]), down(PLACES[1])])
    times = np.arange(len(centres)) * 0.5
    one = TetSpec.along(centres, 6e-3, spacing=PUSHES.spacing, coarsest=PUSHES.coarsest)
    found, wanted = (replay(SETUP, centres, grid, times=times) for grid in (PUSHES, one))
    require_converged([*found, *wanted])
    assert PUSHES.mesh(SETUP, centres[0]) is not PUSHES.mesh(SETUP, centres[-1])
    for here, there in zip(found, wanted, strict=True):
        assert here.force[2] == pytest.approx(there.force[2], rel=0.06, abs=2e-6)
    elastic = replay(replace(SETUP, material=Material()), centres, PUSHES)
    assert abs(found[-1].force[2]) < 0.9 * abs(elastic[-1].force[2])
