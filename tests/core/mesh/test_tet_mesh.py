from __future__ import annotations

import pickle
import signal
import sys
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from shapes import box_surface, dome, filled_box

from palpate.foundation.errors import MeshError, SetupError
from palpate.mesh.box_mesh import GridSpec
from palpate.mesh.tet_fill import TetSpec, _filled, fill
from palpate.setup.free_form.fixed_region import Faces
from palpate.setup.setup import Box, Detachment, Setup, Shape, Support, Tool

SIZE = (0.06, 0.04, 0.03)
TOUCH = np.array([[0.01, 0.0, SIZE[2] + 4e-3]])
SETUP = Setup(geometry=Shape(*box_surface(SIZE)), tool=Tool(radius=5e-3))


def _halved(surface):
    """The same surface with each triangle divided."""
    fine = trimesh.Trimesh(*surface).subdivide().subdivide()
    return np.array(fine.vertices), np.array(fine.faces)


def test_quadratic_field_is_interpolated_exactly():
    mesh = filled_box(SIZE, 6e-3)
    low, high = mesh.nodes.min(axis=0), mesh.nodes.max(axis=0)
    points = np.random.default_rng(0).uniform(low, high, (200, 3))

    def field(x):
        return np.stack([x[:, 0] * x[:, 1], x[:, 2] ** 2 - x[:, 0], 1 + x[:, 1] * x[:, 2]], axis=1)

    assert np.abs(mesh.interpolate(field(mesh.nodes), points) - field(points)).max() < 1e-14


def test_point_outside_takes_the_value_of_the_nearest_surface_point():
    mesh = filled_box(SIZE, 6e-3)
    found = mesh.interpolate(
        mesh.nodes, np.array([[0.0, 0.0, 0.05], [0.05, 0.03, -0.01], [0.04, 0.0, 0.01]])
    )
    assert np.allclose(found, [[0.0, 0.0, 0.03], [0.03, 0.02, 0.0], [0.03, 0.0, 0.01]], atol=1e-12)


def test_mesh_is_fine_only_near_the_tool():
    mesh = fill(SETUP.stated_shape, TetSpec.along(TOUCH, 5e-3, spacing=1e-3, coarsest=5e-3))
    edges = mesh.corners[mesh.tetrahedra]
    longest = np.linalg.norm(edges[:, :, None] - edges[:, None], axis=3).max(axis=(1, 2))
    away = np.linalg.norm(edges.mean(axis=1) - (0.01, 0.0, SIZE[2]), axis=1)
    assert np.median(longest[away < 4e-3]) < 4e-3  # most edges are of 2 mm
    assert np.median(longest[away > 25e-3]) > 6e-3


def test_same_surface_and_motion_give_the_same_mesh():
    spec = TetSpec.along(TOUCH, 5e-3, spacing=2e-3)
    first = fill(SETUP.stated_shape, spec)
    assert fill(Shape(*box_surface(SIZE)), TetSpec.along(TOUCH + 1e-5, 5e-3, spacing=2e-3)) is first
    _filled.cache_clear()
    again = fill(SETUP.stated_shape, spec)
    assert (
        again is not first
        and np.array_equal(again.nodes, first.nodes)
        and np.array_equal(again.tetrahedra, first.tetrahedra)
    )


def test_mesh_survives_pickling():
    mesh = filled_box(SIZE, 8e-3)
    copy = pickle.loads(pickle.dumps(mesh))
    assert np.array_equal(copy.nodes, mesh.nodes) and np.array_equal(
        copy.connectivity.base, mesh.connectivity.base
    )


def test_only_sides_of_the_fixed_region_are_held():
    shape = dome((0.03, 0.02, 0.015))
    mesh = fill(shape, TetSpec(path=(), radius=5e-3, spacing=3e-3, coarsest=3e-3))
    base = mesh.nodes[mesh.connectivity.base]
    assert np.abs(base[..., 2]).max() < 1e-12
    free = mesh.nodes[mesh.connectivity.surface]
    assert free[..., 2].max(axis=1).min() > 1e-4
    assert mesh.corners[:, 2].max() == pytest.approx(0.015, abs=3e-4)


def test_sides_are_held_where_the_named_triangles_are():
    vertices, triangles = box_surface(SIZE)
    left = np.flatnonzero((vertices[triangles, 0] < -0.029).all(axis=1))
    mesh = fill(
        Shape(vertices, triangles, Faces.of(left)),
        TetSpec(path=(), radius=1e-3, spacing=5e-3, coarsest=5e-3),
    )
    assert np.allclose(mesh.nodes[mesh.connectivity.base_nodes, 0], -0.03)


def test_held_region_within_a_flat_side_keeps_its_border():
    shape = Shape(*_halved(box_surface(SIZE)))
    held = np.flatnonzero(
        ((shape.corners[..., 2] > SIZE[2] - 1e-9) & (shape.corners[..., 0] < 0.0151)).all(axis=1)
    )
    mesh = fill(
        replace(shape, fixed=Faces.of(held)),
        TetSpec(path=(), radius=1e-3, spacing=4e-3, coarsest=4e-3),
    )
    sides = mesh.nodes[mesh.connectivity.base[:, :3]]
    areas = (
        np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1) / 2
    )
    assert areas.sum() == pytest.approx(0.045 * SIZE[1], rel=1e-9)


def test_gmsh_leaves_signal_handlers_alone_and_no_model_behind():
    before = signal.getsignal(signal.SIGINT)
    filled_box(SIZE, 9e-3)
    assert signal.getsignal(signal.SIGINT) is before
    assert not sys.modules["gmsh"].isInitialized()


def test_missing_gmsh_is_reported_with_what_to_install(monkeypatch):
    monkeypatch.setenv("PALPATE_MESHER", "gmsh")
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(SetupError, match=r'meshed by Gmsh.*pip install "palpate\[shapes\]"'):
        fill(SETUP.stated_shape, TetSpec(path=(), radius=1e-3, spacing=7.7e-3, coarsest=7.7e-3))


def test_failure_of_gmsh_is_reported_with_the_file(monkeypatch):
    def broken(*_):
        raise RuntimeError("no elements in volume 1")

    monkeypatch.setattr("palpate.mesh.meshers.gmsh_mesher._build", broken)
    with pytest.raises(
        MeshError, match=r"^surface: Gmsh found no tetrahedra .*no elements in volume 1.*0.0066 m"
    ):
        fill(SETUP.stated_shape, TetSpec(path=(), radius=1e-3, spacing=6.6e-3, coarsest=7e-3))


@pytest.mark.parametrize(("spacing", "coarsest"), [(0.0, 1e-3), (2e-3, 1e-3), (1e-3, 2.0)])
def test_spacings_out_of_order_are_refused(spacing, coarsest):
    with pytest.raises(MeshError, match="are not in this order"):
        TetSpec(path=(), radius=1e-3, spacing=spacing, coarsest=coarsest)


def test_finer_mesh_has_closer_nodes():
    spec = TetSpec.along(TOUCH, 5e-3, spacing=3e-3, coarsest=6e-3).finer()
    assert (spec.spacing, spec.coarsest) == pytest.approx((2e-3, 4e-3))


def test_properties_of_a_block_are_refused_for_other_shapes():
    strip = Support(detached=(Detachment(edge="-x", extent=0.01),))
    replace(SETUP, support=strip)  # flat on z = 0: nothing to say
    with pytest.raises(SetupError, match="only a base that lies in z = 0 can be detached"):
        replace(SETUP, geometry=Shape(*box_surface(SIZE), Faces((0, 1, 2, 3, 4, 5))), support=strip)
    with pytest.raises(MeshError, match="hexahedra fill a block only"):
        GridSpec().mesh(SETUP, np.zeros(3))
    with pytest.raises(SetupError, match="mesh a block with a grid of hexahedra"):
        TetSpec(path=(), radius=1e-3).mesh(replace(SETUP, geometry=Box(size=SIZE)), np.zeros(3))


def test_body_as_dict_has_plain_values():
    assert SETUP.as_dict()["geometry"] == {
        "surface": "surface",
        "size": pytest.approx(list(SIZE)),
        "triangles": 12,
        "held": 2,
    }


def test_points_on_the_surface_are_spread_evenly_and_not_on_the_base():
    points = SETUP.stated_shape.surface_points()
    x, y, z = SIZE
    assert (points[:, 2] > 0).all()
    on_top = np.isclose(points[:, 2], z)
    assert on_top.mean() == pytest.approx(x * y / (x * y + 2 * z * (x + y)), abs=0.01)
    assert np.abs(points[on_top, :2].mean(axis=0)).max() < 1e-3
