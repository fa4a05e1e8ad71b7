"""Keys of dataset.toml for phantoms of any shape: unit, upright direction, what holds them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from pushed_block import GRID
from scipy.spatial.transform import Rotation
from shapes import box_surface, write_felt_shape

from palpate.dataset import Dataset, open_dataset
from palpate.dataset.check import check_dataset
from palpate.dataset.check.plausibility import frame_notes
from palpate.foundation.arrays import BoolArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.frames import Transform
from palpate.measurement.touch_correction import touch_correction, touch_misses
from palpate.registration.registration import register, setup_from
from palpate.setup.setup import Shape
from palpate.synthetic.bodies.organ_shape import write_surface

SIZE = (0.06, 0.04, 0.03)
FILE = 'surface = "phantom.stl"'


def _keys(root: Path, old: str, new: str) -> None:
    path = root / "dataset.toml"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def _held(dataset: Dataset) -> BoolArray:
    assert isinstance(dataset.geometry, Shape)
    return dataset.geometry.held


def test_surface_in_millimetres_is_read_in_its_unit(tmp_path: Path) -> None:
    vertices, triangles = box_surface(SIZE)
    root = write_felt_shape(tmp_path, 1e3 * vertices, triangles, FILE + '\nunit = "mm"')
    assert open_dataset(root).config.size == pytest.approx(SIZE, abs=1e-7)


@pytest.mark.parametrize("up", [(0.0, -1.0, 0.0), (0.0, 0.0, -2.0), (1.0, 1.0, 1.0)])
def test_phantom_is_turned_upright_with_all_that_is_stated(
    tmp_path: Path, up: tuple[float, float, float]
) -> None:
    vertices, triangles = box_surface(SIZE)
    unit = np.array(up) / np.linalg.norm(up)
    turn = Rotation.align_vectors(unit[None], np.array([[0.0, 0.0, 1.0]]))[0].as_matrix()
    file_from_upright = Transform(turn, np.array([0.01, 0.2, -0.05]))
    moved = file_from_upright.apply(vertices)
    root = write_felt_shape(tmp_path, moved, triangles, f"{FILE}\nup = {list(up)}")
    text = (root / "dataset.toml").read_text()
    for line in [line for line in text.splitlines() if line.startswith("mark_")]:
        name, _, place = line.partition(" = ")
        there = file_from_upright.apply(np.array(eval(place)))
        text = text.replace(line, f"{name} = {there.tolist()}")
    (root / "dataset.toml").write_text(text)
    dataset = open_dataset(root)
    body = dataset.geometry
    assert body.low[2] == pytest.approx(0.0, abs=1e-6)
    assert body.height == pytest.approx(SIZE[2], abs=1e-6)
    assert _held(dataset).sum() == 2
    (note,) = frame_notes(dataset.config)
    assert note in " ".join(check_dataset(dataset, Transform()).warnings)
    # Touches are in the robot's frame, which is that of the upright block here.
    found = register(dataset)
    assert found.touch_rms < 1e-6
    upright = found.phantom_from_robot.apply(np.array([[0.0, 0.0, 0.0], [0.0, 0.0, SIZE[2]]]))
    assert upright[:, 2] == pytest.approx([0.0, SIZE[2]], abs=1e-6)
    there = dataset.config.phantom_from_file.apply(moved)
    np.testing.assert_allclose(there, found.phantom_from_robot.apply(vertices), atol=1e-6)


def test_upright_phantom_on_the_table_stays_where_its_file_puts_it(tmp_path: Path) -> None:
    dataset = open_dataset(write_felt_shape(tmp_path, *box_surface(SIZE)))
    np.testing.assert_array_equal(dataset.config.phantom_from_file.matrix, np.eye(4))
    assert not frame_notes(dataset.config)


@pytest.mark.parametrize(
    "held",
    [
        "fixed_plane = { point = [0.0, 0.0, 0.002], normal = [0.0, 0.0, 2.0] }",
        'fixed_surface = "tray.stl"',
        "fixed_faces = BASE",
        "fixed_vertices = CORNERS",
    ],
)
def test_what_is_held_is_stated_in_any_of_four_ways(tmp_path: Path, held: str) -> None:
    vertices, triangles = box_surface(SIZE)
    root = write_felt_shape(tmp_path, vertices, triangles, 'surface = "phantom.ply"')
    trimesh.Trimesh(vertices, triangles, process=False).export(root / "phantom.ply")
    tray = np.array(
        [[-0.1, -0.1, -2e-4], [0.1, -0.1, -2e-4], [0.1, 0.1, -2e-4], [-0.1, 0.1, -2e-4]]
    )
    write_surface(root / "tray.stl", tray, np.array([[0, 1, 2], [0, 2, 3]]))
    base = np.flatnonzero((vertices[triangles, 2] < 1e-9).all(axis=1))
    corners = np.flatnonzero(vertices[:, 2] < 1e-9)
    stated = held.replace("BASE", str(base.tolist())).replace("CORNERS", str(corners.tolist()))
    _keys(root, 'fixed = "base"', stated)
    dataset = open_dataset(root)
    np.testing.assert_array_equal(np.flatnonzero(_held(dataset)), base)
    assert dataset.config.fixed == held.partition(" ")[0]


def test_things_in_view_are_read_with_the_phantom(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE), FILE + '\nholder = ["tray.stl"]')
    with pytest.raises(DatasetError, match=r"tray.stl: not found"):
        open_dataset(root)
    corners = np.array([[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.1, 0.1, 0.0]])
    write_surface(root / "tray.stl", corners, np.array([[0, 1, 2]]))
    ((vertices, faces),) = open_dataset(root).geometry.in_view
    np.testing.assert_allclose(vertices, corners, atol=1e-7)
    assert faces.shape == (1, 3)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (FILE, FILE + '\nunit = "inch"', 'phantom.unit = .* "m", "cm" or "mm"'),
        (FILE, FILE + "\nup = [0, 0, 0]", "phantom.up = .* not all of them zero"),
        (FILE, FILE + "\nup = [0, 0]", "phantom.up = .* three numbers"),
        ('fixed = "base"', 'fixed = "top"', "phantom.fixed = 'top'; expected 'base'"),
        ('fixed = "base"', 'fixed = "base"\nfixed_faces = [0]', "no such key beside fixed_faces"),
        (
            'fixed = "base"',
            'fixed_faces = [0]\nfixed_surface = "a.stl"',
            "one statement of what is",
        ),
        (
            'fixed = "base"',
            "fixed_faces = [400]",
            "names triangle 400; expected numbers from 0 to 11",
        ),
        ('fixed = "base"', "fixed_faces = [0.5]", "fixed_faces = .* whole numbers"),
        ('fixed = "base"', "fixed_vertices = [99]", "names vertex 99; expected numbers from 0 to"),
        (
            'fixed = "base"',
            "fixed_plane = { point = [0, 0, -0.1], normal = [0, 0, 1] }",
            "no triangle lies below z = -0.1 m",
        ),
        ('fixed = "base"', "fixed_plane = { point = [0, 0, 0] }", "fixed_plane.normal is missing"),
        (FILE, FILE + "\nfixed_tolerance = 1.0", "fixed_tolerance = 1.0; .* 0.05 m"),
        ("[landmarks]", '[landmarks]\ntouch_offset = "cube"', "touch_offset = 'cube'; expected"),
        ("[splits]", "[robot]\nposition_sigma = 0.1\n[splits]", "phantom_from_robot is missing"),
    ],
)
def test_wrong_key_is_refused_in_words(tmp_path: Path, old: str, new: str, words: str) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    _keys(root, old, new)
    with pytest.raises(DatasetError, match=words):
        open_dataset(root)


def test_box_has_no_keys_of_a_surface(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    _keys(root, 'geometry = "mesh"\nsurface = "phantom.stl"', 'geometry = "box"\nunit = "mm"')
    with pytest.raises(DatasetError, match=r"phantom.unit = 'mm'; expected no unit for a box"):
        open_dataset(root)


@pytest.mark.parametrize("true_radius", [5e-3, 6e-3])
def test_ball_that_rests_on_the_surface_is_off_it_by_its_radius(
    tmp_path: Path, true_radius: float
) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    places = {
        "mark_0": ((0.02, 0.01, 0.03), (0, 0, 1)),
        "mark_1": ((-0.02, 0.01, 0.03), (0, 0, 1)),
        "mark_2": ((0.03, 0.0, 0.015), (1, 0, 0)),
        "mark_3": ((0.0, 0.02, 0.01), (0, 1, 0)),
        "mark_4": ((-0.03, 0.0, 0.012), (-1, 0, 0)),
    }
    text = (root / "dataset.toml").read_text()
    kept = [line for line in text.splitlines() if not line.startswith("mark_")]
    at = kept.index("[landmarks]") + 1
    kept[at:at] = ['touch_offset = "ball"', *(f"{k} = {list(v[0])}" for k, v in places.items())]
    (root / "dataset.toml").write_text("\n".join(kept))
    centres = [np.array(place) + true_radius * np.array(way) for place, way in places.values()]
    rows = [f"{k},{x:.6f},{y:.6f},{z:.6f}" for k, (x, y, z) in zip(places, centres, strict=True)]
    (root / "touches.csv").write_text("\n".join(["landmark,x,y,z", *rows]) + "\n")
    dataset = open_dataset(root)
    found = register(dataset)
    stated = setup_from(dataset, found)
    assert (found.touch_rms < 1e-9) == (true_radius == 5e-3)
    true = replace(stated, tool=replace(stated.tool, radius=true_radius))
    assert np.abs(touch_misses(true, GRID)).max() < 1e-9
    there = touch_correction(true, GRID) @ found.phantom_from_robot
    np.testing.assert_allclose(there.matrix, np.eye(4), atol=1e-9)
