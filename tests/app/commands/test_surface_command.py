"""`palpate surface` shows a surface, repairs it on request, and writes what a dataset takes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from shapes import write_felt_shape
from typer.testing import CliRunner, Result

from palpate.app.cli import app
from palpate.dataset import open_dataset
from palpate.foundation.errors import MeshError
from palpate.setup.free_form.shape import load_shape


def palpate(*arguments: object) -> Result:
    return CliRunner().invoke(app, ["surface", *map(str, arguments)], env={"COLUMNS": "160"})


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """A ball of 20 mm radius as a scanner gives it: in mm, open below, mixed, with a stray part."""
    ball, stray = trimesh.creation.icosphere(4, 20.0), trimesh.creation.icosphere(1, 2.0)
    faces = ball.faces[ball.triangles_center[:, 2] > -8.0]
    faces[::7] = faces[::7][:, ::-1]
    whole = trimesh.util.concatenate(
        [
            trimesh.Trimesh(
                ball.vertices + np.array([0, 0, 40]), np.concatenate([faces, faces[:9]])
            ),
            stray.apply_translation([60, 0, 40]),
        ]
    )
    whole.export(tmp_path / "scan.stl")
    return tmp_path / "scan.stl"


def test_scan_is_shown_and_nothing_is_changed(scan: Path) -> None:
    before = scan.read_bytes()
    shown = palpate(scan, "--unit", "mm")
    assert shown.exit_code == 1 and scan.read_bytes() == before
    for words in (
        "doubled triangles 9",
        "bodies 2",
        "mixed,",
        "82 x 40 x 28.7",
        "to mend it add: --clean --body 1 --orient --close-base --on-table",
    ):
        assert words in " ".join(shown.output.split()), shown.output
    assert list(scan.parent.iterdir()) == [scan]


def test_scan_is_repaired_to_a_surface_that_a_dataset_takes(scan: Path, tmp_path: Path) -> None:
    options = ("--clean", "--body", "1", "--orient", "--close-base", "--tolerance", "0.2")
    picture, target = tmp_path / "seen.png", tmp_path / "new.stl"
    done = palpate(
        scan, "--unit", "mm", *options, "--on-table", "--out", target, "--picture", picture
    )
    assert done.exit_code == 0, done.output
    shape = load_shape(target)
    height = 20.0 - (-8.0)
    wanted = 1e-9 * np.pi * height**2 * (20.0 - height / 3)
    assert shape.volume == pytest.approx(wanted, rel=0.04)
    assert abs(shape.low[2]) < 1e-9 and shape.flat_base and shape.held.sum() > 3
    assert "9 doubled triangles" in done.output and "removed 80" in done.output
    assert "within 0.2 mm" in done.output and "moved as a whole" in done.output
    with Image.open(picture) as seen:
        colours = np.array(seen.convert("RGB")).reshape(-1, 3)
    assert (colours[:, 0] > 1.8 * colours[:, 2].clip(1)).sum() > 1000  # the inside, in red
    root = tmp_path / "set"
    root.mkdir()
    write_felt_shape(root, shape.vertices, shape.triangles)
    assert open_dataset(root).config.size[2] == pytest.approx(0.0284, abs=5e-4)


def test_surface_that_stays_open_is_not_written(scan: Path, tmp_path: Path) -> None:
    left = palpate(scan, "--unit", "mm", "--clean", "--out", tmp_path / "new.stl")
    assert left.exit_code == 2 and "was not written" in left.output
    assert not (tmp_path / "new.stl").exists()


def test_file_is_replaced_only_on_demand(scan: Path, tmp_path: Path) -> None:
    target = tmp_path / "new.stl"
    target.write_bytes(b"mine")
    options = (scan, "--unit", "mm", "--clean", "--body", 2, "--out", target)
    refused = palpate(*options)
    assert isinstance(refused.exception, MeshError) and "--overwrite" in str(refused.exception)
    assert target.read_bytes() == b"mine"
    assert palpate(*options, "--overwrite").exit_code == 0
    assert target.read_bytes() != b"mine"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--unit", "inch"), "--unit is 'inch'; expected one of m, cm, mm"),
        (("--out", "new.ply"), "written as STL; name it new.stl"),
        (("--out", "no/such/folder/new.stl"), "is no folder; make it first"),
        (("--body", "5", "--unit", "mm"), "holds 2 bodies, number 5 was asked for"),
        (("--up", "left", "--unit", "mm"), "expected x, y, z"),
    ],
)
def test_wrong_options_are_refused_in_words(
    scan: Path, options: tuple[str, ...], words: str
) -> None:
    refused = palpate(scan, *options)
    assert isinstance(refused.exception, MeshError) and words in str(refused.exception)
