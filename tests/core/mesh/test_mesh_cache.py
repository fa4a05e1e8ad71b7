"""Meshes of shapes are stored by content, and made again where a file is damaged."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import box_surface

from palpate.foundation.errors import MeshError
from palpate.mesh.meshers.mesh_cache import FOLDER
from palpate.mesh.meshers.mesh_quality import measured_mesh, tetrahedron_qualities
from palpate.mesh.meshers.mesher_choice import chosen_mesher
from palpate.mesh.tet_fill import TetSpec, _filled, fill
from palpate.setup.free_form.fixed_region import Faces
from palpate.setup.free_form.shape import Shape

SIZE = (0.06, 0.04, 0.03)
SPEC = TetSpec(path=(), radius=1e-3, spacing=8.1e-3, coarsest=8.1e-3)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    if not chosen_mesher().is_there:
        pytest.skip("no mesher is installed")
    monkeypatch.setenv(FOLDER, str(tmp_path / "meshes"))
    _filled.cache_clear()
    return tmp_path / "meshes"


def _unable(*_):
    raise RuntimeError("nothing may be meshed")


def test_second_process_meshes_nothing(folder, monkeypatch):
    first = fill(Shape(*box_surface(SIZE)), SPEC)
    assert len(list(folder.iterdir())) == 1
    _filled.cache_clear()
    monkeypatch.setattr(type(chosen_mesher()), "tetrahedra", _unable)
    again = fill(Shape(*box_surface(SIZE), name="copy"), SPEC)
    assert np.array_equal(again.corners, first.corners)
    assert np.array_equal(again.tetrahedra, first.tetrahedra)
    assert np.array_equal(again.held, first.held)
    with pytest.raises(MeshError, match="nothing may be meshed"):
        fill(Shape(*box_surface(SIZE), Faces((0, 1))), SPEC)  # held elsewhere
    with pytest.raises(MeshError, match="nothing may be meshed"):
        fill(Shape(*box_surface(SIZE)), SPEC.finer())


def test_damaged_file_is_made_anew(folder):
    first = fill(Shape(*box_surface(SIZE)), SPEC)
    (file,) = folder.iterdir()
    whole = file.read_bytes()
    for broken in (b"", whole[:100], b"no archive at all"):
        file.write_bytes(broken)
        _filled.cache_clear()
        assert np.array_equal(fill(Shape(*box_surface(SIZE)), SPEC).corners, first.corners)
        assert len(file.read_bytes()) == len(whole)


def test_folder_that_cannot_be_written_is_left_alone(folder):
    folder.write_text("a file in its place")
    assert len(fill(Shape(*box_surface(SIZE)), SPEC).tetrahedra)


def test_nothing_is_stored_without_a_folder(folder, monkeypatch):
    monkeypatch.delenv(FOLDER)
    fill(Shape(*box_surface(SIZE)), SPEC)
    assert not folder.exists()


def test_quality_is_one_for_a_regular_tetrahedron_and_falls_to_zero():
    regular = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    flat = regular * (1.0, 1.0, 1e-9)
    found = tetrahedron_qualities(
        np.concatenate([regular, flat]), np.array([[0, 2, 1, 3], [4, 6, 5, 7]])
    )
    assert np.abs(found) == pytest.approx([1.0, 0.0], abs=1e-8)


def test_mesh_is_measured(folder):
    made = measured_mesh(lambda: fill(Shape(*box_surface(SIZE)), SPEC))
    assert made.tetrahedra > 20 and made.nodes > 50
    assert 0 < made.least <= made.typical <= 1 and made.seconds > 0
