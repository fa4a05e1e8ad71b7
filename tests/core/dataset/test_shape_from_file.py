"""Phantoms that are no box: their surface is read with the dataset, and a bad one is refused in
words.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from shapes import box_surface, write_felt_shape

from palpate.dataset import open_dataset
from palpate.dataset.check import check_dataset
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import DatasetError
from palpate.foundation.frames import Transform
from palpate.registration.registration import register, setup_from
from palpate.setup.setup import Shape
from palpate.synthetic.bodies.organ_shape import organ_surface, write_surface

SIZE = (0.06, 0.04, 0.03)


def test_mesh_is_read_with_its_size_and_held_at_its_base(tmp_path: Path) -> None:
    dataset = open_dataset(write_felt_shape(tmp_path, *box_surface(SIZE)))
    assert isinstance(dataset.geometry, Shape)
    assert dataset.config.size == pytest.approx(SIZE, abs=1e-7)
    assert not dataset.has_rest and not dataset.observed
    held = dataset.geometry.corners[dataset.geometry.held]
    assert np.abs(held[..., 2]).max() < 1e-9 and len(held) == 2


def test_force_only_mesh_is_registered_checked_and_set_up(tmp_path: Path) -> None:
    dataset = open_dataset(write_felt_shape(tmp_path, *box_surface(SIZE)))
    found = register(dataset)
    assert found.camera is None and found.touch_rms < 1e-9
    assert setup_from(dataset, found).geometry is dataset.geometry
    summary = check_dataset(dataset, Transform())
    (contact,) = summary.sequences[0].motion.contacts  # type: ignore[union-attr]
    assert contact.kind == "top" and contact.depth == pytest.approx(4e-3, abs=2e-4)
    sentences = " ".join(lack.sentence for lack in summary.lacks)
    assert (
        "no clouds" in sentences
        and "1 pushes in all" in sentences
        and "drag" not in sentences
        and "no forces" not in sentences
    )


def test_rest_cloud_without_other_clouds_is_no_reason_to_register_a_camera(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    header = (
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
        "y\nproperty float z\nend_header\n0 0 0.4\n"
    )
    (root / "rest.ply").write_text(header)
    assert register(open_dataset(root)).camera is None


def _broken(case: str) -> tuple[FloatArray, IntArray]:
    vertices, triangles = box_surface(SIZE)
    if case == "open":
        return vertices, triangles[:-1]
    if case == "millimetres":
        return 1e3 * vertices, triangles
    if case == "inside out":
        return vertices, triangles[:, ::-1]
    if case == "off the table":
        return vertices + np.array([0.0, 0.0, 0.02]), triangles
    return vertices, np.concatenate([triangles, triangles[:1]])


@pytest.mark.parametrize(
    ("case", "words"),
    [
        ("open", "phantom.stl: is open: .* expected a closed surface: close it"),
        ("millimetres", "phantom.stl: measures 60 x 40 x 30 m .* in mm, export it in metres"),
        ("inside out", "phantom.stl: all 12 triangles turn inwards .* flip the normals"),
        ("doubled", "phantom.stl: 3 edges belong to more than two triangles"),
    ],
)
def test_surface_that_encloses_nothing_is_refused(tmp_path: Path, case: str, words: str) -> None:
    root = write_felt_shape(tmp_path, *_broken(case))
    with pytest.raises(DatasetError, match=words) as caught:
        open_dataset(root)
    assert caught.value.where["file"] == "phantom.stl"


@pytest.mark.parametrize(
    ("surface", "words"),
    [
        ('surface = "other.stl"', "other.stl: not found; expected this file"),
        (
            'surface = "dataset.toml"',
            "dataset.toml: is no surface that can be read; expected one of .stl",
        ),
        ('surface = "../phantom.stl"', "phantom.surface .* plain name without slashes"),
        ("", "phantom.surface is missing"),
    ],
)
def test_surface_that_is_not_there_is_refused(tmp_path: Path, surface: str, words: str) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE), surface)
    with pytest.raises(DatasetError, match=words):
        open_dataset(root)


def test_file_that_is_no_surface_is_refused(tmp_path: Path) -> None:
    root = write_felt_shape(tmp_path, *box_surface(SIZE))
    (root / "phantom.stl").write_bytes(b"no surface at all")
    with pytest.raises(DatasetError, match=re.escape("phantom.stl: ")):
        open_dataset(root)


def test_organ_of_the_bench_is_a_surface_that_passes(tmp_path: Path) -> None:
    vertices, triangles = organ_surface()
    write_surface(tmp_path / "phantom.stl", vertices, triangles)
    shape = Shape(vertices, triangles)
    assert shape.flat_base and 5e-5 < shape.volume < 7e-5
