"""Each check of a surface fails on a surface with one defect, and its message has the numbers."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from PIL import Image
from shapes import box_surface

from palpate.foundation.errors import MeshError
from palpate.setup.free_form.fixed_region import Faces, Painted, Plane
from palpate.setup.free_form.shape import load_shape
from palpate.setup.setup import Shape

SIZE = (0.06, 0.04, 0.03)


def _stored(folder, vertices, triangles, name="organ.ply", kind=None):
    path = folder / name
    trimesh.Trimesh(vertices, triangles, process=False).export(path, file_type=kind)
    return path


@pytest.mark.parametrize("name", ["organ.stl", "organ.ply", "organ.obj"])
def test_closed_surface_is_read_from_every_format(tmp_path, name):
    shape = load_shape(_stored(tmp_path, *box_surface(SIZE), name))
    assert shape.volume == pytest.approx(np.prod(SIZE), rel=1e-6)
    assert len(shape.vertices) == 8 and len(shape.triangles) == 12  # an STL's 36 corners are merged
    assert shape.size == pytest.approx(SIZE)


def test_texture_of_a_surface_is_not_read(tmp_path, monkeypatch):
    path = _stored(tmp_path, *box_surface(SIZE), "organ.obj")
    path.write_text("mtllib organ.mtl\nusemtl skin\n" + path.read_text())
    (tmp_path / "organ.mtl").write_text("newmtl skin\nmap_Kd skin.png\n")
    Image.new("RGB", (4, 4)).save(tmp_path / "skin.png")
    opened = []
    monkeypatch.setattr(Image, "open", lambda file, *_: opened.append(file))
    shape = load_shape(path)
    assert len(shape.vertices) == 8 and not opened


def test_file_that_is_too_large_is_not_read(tmp_path):
    path = tmp_path / "organ.stl"
    with path.open("wb") as file:
        file.truncate(2**25 + 1)
    with pytest.raises(MeshError, match="has 32 MiB, at most 32 are read: decimate it"):
        load_shape(path)


def test_hole_is_reported_with_its_open_edges_and_place(tmp_path):
    vertices, triangles = box_surface(SIZE)
    top = (vertices[triangles, 2] > 0.02).all(axis=1)
    with pytest.raises(
        MeshError,
        match=r"^organ.ply: is open: 4 of 17 edges .* 1 hole.*"
        r"largest of 4 edges at \(.*0\.0300\) m",
    ):
        load_shape(_stored(tmp_path, vertices, triangles[~top]))


def test_corners_that_nearly_meet_are_to_be_merged_and_no_holes(tmp_path):
    vertices, triangles = box_surface(SIZE)
    corners = vertices[triangles].reshape(-1, 3)
    moved = corners + 2e-8 * np.random.default_rng(0).uniform(-1, 1, corners.shape)
    with pytest.raises(MeshError, match=r"is open: 36 of 36 .* own, up to \S+ m apart.* --clean"):
        Shape(moved, np.arange(len(moved)).reshape(-1, 3))
    with pytest.raises(MeshError, match=r"hole\(s\)"):  # apart by 0.1 mm: these are holes
        Shape(moved + 5e3 * (moved - corners), np.arange(len(moved)).reshape(-1, 3))


def test_flipped_triangle_is_reported_with_its_number():
    vertices, triangles = box_surface(SIZE)
    triangles[7] = triangles[7][::-1]
    with pytest.raises(
        MeshError, match="1 of 12 triangles are flipped against the rest, the first is number 7 at"
    ) as error:
        Shape(vertices, triangles)
    assert error.value.where["triangle"] == 7


def test_surface_inside_out_is_reported():
    vertices, triangles = box_surface(SIZE)
    with pytest.raises(MeshError, match=r"all 12 triangles turn inwards \(volume -72 cm3\)"):
        Shape(vertices, triangles[:, ::-1])


def test_crossing_triangles_are_reported_with_their_place():
    sphere = trimesh.creation.icosphere(2, 0.02)
    vertices = np.array(sphere.vertices) + np.array([0, 0, 0.02])
    top = int(np.argmax(vertices[:, 2]))
    vertices[top, 2] = -0.01  # a spike from the top through the bottom
    with pytest.raises(
        MeshError, match=r"\d+ pairs of triangles cross, the first are numbers \d+ and \d+ at \("
    ) as error:
        Shape(vertices, np.array(sphere.faces))
    assert error.value.where["crossings"] >= 5


def test_surface_in_millimetres_is_reported_and_scaled_only_on_request(tmp_path):
    vertices, triangles = box_surface(SIZE)
    path = _stored(tmp_path, 1e3 * vertices, triangles)
    message = (
        r"measures 60 x 40 x 30 m .* if it is in millimetres, say so with scale = 0.001, "
        r"which makes it 0.06 x 0.04 x 0.03 m"
    )
    with pytest.raises(MeshError, match=message):
        load_shape(path)
    assert load_shape(path, scale=1e-3).size == pytest.approx(SIZE)


def test_surface_scaled_from_millimetres_twice_is_reported():
    vertices, triangles = box_surface(SIZE)
    with pytest.raises(MeshError, match=r"scaled from millimetres twice, say so with scale = 1000"):
        Shape(1e-3 * vertices, triangles)


def test_two_bodies_are_reported_with_their_volumes():
    one, other = box_surface(SIZE), box_surface((0.01, 0.01, 0.01))
    vertices = np.concatenate([one[0], other[0] + np.array([0.1, 0.0, 0.0])])
    with pytest.raises(
        MeshError, match=r"holds 2 separate surfaces \(the largest enclose 72, 1 cm3\)"
    ):
        Shape(vertices, np.concatenate([one[1], other[1] + 8]))


def test_vertex_that_is_not_finite_is_reported_with_its_number():
    vertices, triangles = box_surface(SIZE)
    vertices[3, 1] = np.nan
    with pytest.raises(MeshError, match="1 of 8 vertices are not finite, the first is number 3"):
        Shape(vertices, triangles)


def test_empty_surface_is_reported():
    with pytest.raises(MeshError, match=r"holds no triangle \(0 vertices\)"):
        Shape(np.empty((0, 3)), np.empty((0, 3), np.int64))


def test_collapsed_triangle_is_reported_with_its_number():
    vertices, triangles = box_surface(SIZE)
    triangles = np.concatenate([triangles, [[1, 1, 2]]])
    with pytest.raises(
        MeshError, match="1 of 13 triangles have a corner twice, the first is number 12"
    ):
        Shape(vertices, triangles)


def test_doubled_wall_is_reported_with_its_edges():
    vertices, triangles = box_surface(SIZE)
    with pytest.raises(MeshError, match="3 edges belong to more than two triangles"):
        Shape(vertices, np.concatenate([triangles, triangles[:1]]))


@pytest.mark.parametrize(
    ("name", "message"),
    [("gone.stl", "there is no such file"), ("organ.step", "is read from .stl, .ply, .obj, not")],
)
def test_file_that_is_no_surface_is_reported(tmp_path, name, message):
    with pytest.raises(MeshError, match=message):
        load_shape(tmp_path / name)


def test_file_that_cannot_be_read_is_reported(tmp_path):
    (tmp_path / "organ.ply").write_bytes(
        b"ply\nformat ascii 1.0\nelement vertex 3\nend_header\nnothing"
    )
    with pytest.raises(MeshError, match=r"^organ.ply: "):
        load_shape(tmp_path / "organ.ply")


def test_fixed_region_is_a_plane_or_triangles_or_painted_vertices():
    vertices, triangles = box_surface(SIZE)
    low = vertices[:, 2] < 1e-9
    by_plane = Shape(vertices, triangles).held
    assert by_plane.sum() == 2
    assert np.array_equal(
        Shape(vertices, triangles, Faces.of(np.flatnonzero(by_plane))).held, by_plane
    )
    assert np.array_equal(Shape(vertices, triangles, Painted.of(low)).held, by_plane)
    assert np.array_equal(
        Shape(vertices, triangles, Painted.of(np.flatnonzero(low))).held, by_plane
    )


@pytest.mark.parametrize(
    ("fixed", "message"),
    [
        (
            Plane(height=-0.01),
            r"no triangle lies below z = -0.01 m within 0.0001 m, the lowest reaches up to 0 m",
        ),
        (Faces((3, 12)), "names triangle 12; expected numbers from 0 to 11"),
        (Faces(()), "names no triangle at all"),
        (Painted((0, 1)), "the 2 painted vertices are nowhere all three corners"),
        (Plane(height=1.0), "all 12 triangles are held"),
    ],
)
def test_impossible_fixed_region_is_reported(fixed, message):
    with pytest.raises(MeshError, match=message):
        Shape(*box_surface(SIZE), fixed)


def test_bodies_with_equal_surface_and_fixed_region_are_equal():
    vertices, triangles = box_surface(SIZE)
    assert Shape(vertices, triangles) == Shape(vertices.copy(), triangles, name="other")
    assert hash(Shape(vertices, triangles)) == hash(Shape(vertices.copy(), triangles))
    assert Shape(vertices, triangles) != Shape(vertices, triangles, Faces((0,)))


def test_nearest_point_is_the_point_itself_inside_and_on_the_surface_outside():
    shape = Shape(*box_surface(SIZE))
    points = np.array([[0.01, 0.0, 0.02], [0.05, 0.0, 0.01], [0.05, 0.05, 0.05], [0.0, 0.0, -0.02]])
    wanted = [[0.01, 0.0, 0.02], [0.03, 0.0, 0.01], [0.03, 0.02, 0.03], [0.0, 0.0, 0.0]]
    assert np.allclose(shape.nearest(points), wanted, atol=1e-12)
