from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.errors import MeshError
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.mesh.elements import HEXAHEDRA, quadrature
from palpate.mesh.grid_axes import even_axis, graded_axis

SIZE = (0.0687, 0.0393, 0.0358)
GRIDS = pytest.mark.parametrize(
    "grid",
    [
        GridSpec(),
        GridSpec(nodes=(9, 8, 7), spacing=1e-3),
        GridSpec(nodes=(9, 7, 5), spacing=1e-3, order=2),
    ],
    ids=["even", "graded", "quadratic"],
)


@GRIDS
def test_elements_fill_the_block_without_overlap(grid):
    mesh = box_mesh(SIZE, grid)
    weights = quadrature(HEXAHEDRA[grid.order], mesh.nodes[mesh.hexahedra]).weights
    assert weights.min() > 0
    assert weights.sum() == pytest.approx(np.prod(SIZE), rel=1e-12)


@GRIDS
def test_block_stands_on_the_table_centred(grid):
    mesh = box_mesh(SIZE, grid)
    assert np.allclose(mesh.nodes.min(axis=0), [-SIZE[0] / 2, -SIZE[1] / 2, 0])
    assert np.allclose(mesh.nodes.max(axis=0), [SIZE[0] / 2, SIZE[1] / 2, SIZE[2]])
    assert np.allclose(mesh.nodes[mesh.base_nodes, 2], 0)
    assert len(mesh.base_nodes) == grid.nodes[0] * grid.nodes[1]


@GRIDS
@pytest.mark.parametrize("side", ["-x", "+x", "-y", "+y", "-z", "+z"])
def test_faces_of_each_side_face_outwards_and_cover_it(grid, side):
    mesh = box_mesh(SIZE, grid)
    corners = mesh.nodes[mesh.faces[side]]
    normals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]) / 2
    axis, sign = "xyz".index(side[1]), 1 if side[0] == "+" else -1
    area = np.prod([SIZE[a] for a in range(3) if a != axis])
    assert np.allclose(np.delete(normals, axis, axis=1), 0)
    assert (sign * normals[:, axis] > 0).all()
    assert sign * normals[:, axis].sum() == pytest.approx(area, rel=1e-12)


@GRIDS
@pytest.mark.parametrize("side", ["-x", "+x", "-y", "+y", "-z", "+z"])
def test_sides_of_the_elements_face_outwards_and_cover_it(grid, side):
    mesh, face = box_mesh(SIZE, grid), HEXAHEDRA[grid.order].face
    tangents = np.einsum("qac,fai->fqci", face.gradients, mesh.nodes[mesh.element_sides[side]])
    areas = face.weights[:, None] * np.cross(tangents[:, :, 0], tangents[:, :, 1])
    outward = np.zeros(3)
    outward["xyz".index(side[1])] = 1 if side[0] == "+" else -1
    assert (areas @ outward > 0).all()
    assert np.allclose(
        areas.sum(axis=(0, 1)), outward * np.prod(np.array(SIZE)[outward == 0]), rtol=1e-12
    )


def test_free_surface_is_everything_but_the_base():
    mesh = box_mesh(SIZE, GridSpec())
    total = sum(len(faces) for faces in mesh.faces.values())
    assert len(mesh.free_surface) == total - len(mesh.faces["-z"])


def test_graded_axis_is_finest_at_its_focus_and_has_the_requested_spacing():
    axis = graded_axis(-0.034, 0.034, 25, 0.01, 8e-4)
    steps = np.diff(axis)
    nearest = np.abs((axis[1:] + axis[:-1]) / 2 - 0.01).argmin()
    assert len(axis) == 25
    assert axis[0] == pytest.approx(-0.034) and axis[-1] == pytest.approx(0.034)
    assert steps[nearest] == pytest.approx(8e-4, rel=0.15)
    assert np.abs(axis - 0.01).min() < 1e-12
    assert (np.diff(steps[nearest + 1 :]) > 0).all() and (np.diff(steps[: nearest - 1]) < 0).all()


@pytest.mark.parametrize("focus", [-0.02, -0.0199, 0.0, 0.0199, 0.02])
def test_graded_axis_keeps_its_ends_wherever_the_focus_is(focus):
    axis = graded_axis(-0.02, 0.02, 11, focus, 1e-3)
    assert len(axis) == 11
    assert (np.diff(axis) > 0).all()
    assert axis[0] == pytest.approx(-0.02) and axis[-1] == pytest.approx(0.02)


def test_axis_with_enough_nodes_for_the_spacing_is_even():
    assert np.allclose(graded_axis(0.0, 0.01, 21, 0.005, 1e-3), even_axis(0.0, 0.01, 21))


@GRIDS
def test_interpolation_is_exact_for_trilinear_fields(grid):
    mesh = box_mesh(SIZE, grid)

    def field(points: np.ndarray) -> np.ndarray:
        x, y, z = points.T
        return np.stack([1 + 2 * x, y - 3 * z, 5 * x - z], axis=1)

    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    points = np.random.default_rng(0).uniform(low, high, (200, 3))
    assert np.allclose(mesh.interpolate(field(mesh.nodes), points), field(points), atol=1e-14)
    assert np.allclose(
        mesh.interpolate(field(mesh.nodes), mesh.nodes), field(mesh.nodes), atol=1e-14
    )


def test_points_outside_take_the_value_of_the_nearest_surface_point():
    mesh = box_mesh(SIZE, GridSpec())
    outside, foot = np.array([[0.0, 0.0, 0.05]]), np.array([[0.0, 0.0, SIZE[2]]])
    assert np.allclose(mesh.interpolate(mesh.nodes, outside), foot)


def test_weights_of_a_point_add_up_to_one():
    mesh = box_mesh(SIZE, GridSpec())
    _, weights = mesh.locate(np.random.default_rng(1).uniform(-0.05, 0.05, (50, 3)))
    assert np.allclose(weights.sum(axis=1), 1) and (weights >= -1e-15).all()


def test_grid_is_parsed_from_text_and_errors_name_the_format():
    assert GridSpec.parse("25X9x9") == GridSpec(nodes=(25, 9, 9))
    with pytest.raises(MeshError, match=r"reads like 13x5x5.*'13x5'"):
        GridSpec.parse("13x5")
    with pytest.raises(MeshError, match="2 to 400 nodes"):
        GridSpec(nodes=(1, 5, 5))
    with pytest.raises(MeshError, match="not between 0 and 1 m"):
        GridSpec(spacing=-1e-3)
