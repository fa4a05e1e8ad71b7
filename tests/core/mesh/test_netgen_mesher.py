"""Netgen fills shapes as Gmsh does: whole, graded, on their surface, and every time the same."""

from __future__ import annotations

import signal
import sys

import numpy as np
import pytest
from shapes import box_surface, dome

from palpate.foundation.errors import MeshError, SetupError
from palpate.mesh.meshers.mesher_choice import chosen_mesher
from palpate.mesh.push_meshes import REPLAY_PUSHES
from palpate.mesh.tet_fill import TetSpec, _filled, fill
from palpate.replay.replay import Replay
from palpate.setup.free_form.shape import Shape
from palpate.setup.setup import Setup, Tool
from palpate.synthetic.bodies.shape_families import FAMILIES, draw_shape

SIZE = (0.06, 0.04, 0.03)


@pytest.fixture
def netgen(monkeypatch):
    pytest.importorskip("netgen")
    monkeypatch.setenv("PALPATE_MESHER", "netgen")


def _qualities(mesh):
    """Volumes of tetrahedra over that of a regular one with their mean square edge (e,) [1]."""
    corners = mesh.corners[mesh.tetrahedra]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    edges = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3)
    return 6 * np.sqrt(2) * volumes / ((edges**2).sum(axis=(1, 2)) / 12) ** 1.5


@pytest.mark.parametrize("family", FAMILIES)
def test_families_of_shapes_are_filled_up_to_their_surface(netgen, family):
    shape = draw_shape(family, 1)
    top = shape.vertices[shape.vertices[:, 2].argmax()]
    spec = TetSpec.along(top[None], 4e-3, spacing=1.6e-3, growth=0.6, coarsest=4e-3)
    mesh = fill(shape, spec)
    distance, _ = shape.facing(mesh.nodes[mesh.connectivity.hull].reshape(-1, 3))
    assert np.sqrt(np.mean(distance**2)) < 6e-4
    assert _qualities(mesh).min() > 0.1
    assert np.abs(mesh.nodes[mesh.connectivity.base_nodes, 2]).max() < 1e-9
    middles = mesh.corners[mesh.tetrahedra].mean(axis=1)
    near = np.linalg.norm(middles - top, axis=1) < 5e-3
    far = np.linalg.norm(middles - top, axis=1) > 25e-3
    corners = mesh.corners[mesh.tetrahedra]
    longest = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3).max(axis=(1, 2))
    assert np.median(longest[near]) < 6e-3 < np.median(longest[far])


def test_block_is_filled_exactly_and_the_same_again(netgen):
    shape = Shape(*box_surface(SIZE))
    spec = TetSpec(path=(), radius=1e-3, spacing=5e-3, coarsest=5e-3)
    first = fill(shape, spec)
    corners = first.corners[first.tetrahedra]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6
    assert volumes.min() > 0 and volumes.sum() == pytest.approx(np.prod(SIZE), rel=1e-9)
    _filled.cache_clear()
    again = fill(shape, spec)
    assert np.array_equal(again.corners, first.corners)
    assert np.array_equal(again.tetrahedra, first.tetrahedra)


def test_push_resists_as_on_a_mesh_of_gmsh(netgen, monkeypatch):
    pytest.importorskip("gmsh")
    body = Setup(geometry=dome((0.03, 0.022, 0.02)), tool=Tool(radius=5e-3))
    place = np.array([[0.0, 0.0, 0.02]])
    forces = []
    for name in ("netgen", "gmsh"):
        monkeypatch.setenv("PALPATE_MESHER", name)
        spec = REPLAY_PUSHES.at(place)
        _forget()
        centre = place[0] + np.array([0.0, 0.0, 2e-3])
        forces.append(Replay(body, spec, 1e-4).solve_from_any(centre, (None,)).force[2])
    assert forces[0] == pytest.approx(forces[1], rel=0.04)


def _forget():
    from palpate.mesh import push_meshes

    push_meshes._filled.cache_clear()


def test_netgen_leaves_signal_handlers_alone(netgen):
    before = signal.getsignal(signal.SIGINT)
    fill(Shape(*box_surface(SIZE)), TetSpec(path=(), radius=1e-3, spacing=9e-3, coarsest=9e-3))
    assert signal.getsignal(signal.SIGINT) is before


def test_failure_of_netgen_is_reported_with_the_file(netgen, monkeypatch):
    def broken(*_):
        raise RuntimeError("surface meshing failed")

    monkeypatch.setattr("palpate.mesh.meshers.netgen_mesher._write", broken)
    with pytest.raises(MeshError, match=r"^surface: Netgen found no tetrahedra .*0.0066 m"):
        fill(
            Shape(*box_surface(SIZE)), TetSpec(path=(), radius=1e-3, spacing=6.6e-3, coarsest=7e-3)
        )


def test_missing_netgen_is_reported_with_what_to_install(monkeypatch):
    monkeypatch.setenv("PALPATE_MESHER", "Netgen")
    for name in ("netgen", "netgen.meshing", "netgen.stl"):
        monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(SetupError, match=r"meshed by Netgen.*pip install netgen-mesher"):
        fill(
            Shape(*box_surface(SIZE)), TetSpec(path=(), radius=1e-3, spacing=7.7e-3, coarsest=8e-3)
        )


def test_unknown_mesher_is_refused_and_gmsh_taken_where_it_is(monkeypatch):
    monkeypatch.setenv("PALPATE_MESHER", "tetgen")
    with pytest.raises(SetupError, match="PALPATE_MESHER is 'tetgen'; expected one of gmsh, netg"):
        chosen_mesher()
    monkeypatch.delenv("PALPATE_MESHER")
    monkeypatch.setattr(
        "palpate.mesh.meshers.gmsh_mesher.find_spec", lambda name: object() if name else None
    )
    assert chosen_mesher().name == "Gmsh"
    monkeypatch.setattr("palpate.mesh.meshers.gmsh_mesher.find_spec", lambda _: None)
    assert chosen_mesher().name == "Netgen"
