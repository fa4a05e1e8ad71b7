from __future__ import annotations

import numpy as np
import pytest
from pushed_block import GRID, SETUP, SIZE, poke
from shapes import box_surface, dome, filled_box

from palpate.correction import Body
from palpate.foundation.errors import CorrectionError
from palpate.measurement.metrics import supersampled
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.replay.replay import replay
from palpate.setup.setup import Shape

NODES = (13, 5, 5)
BLOCK = SETUP.geometry


def test_surface_is_that_of_the_papers_metric():
    frame = replay(SETUP, np.array([poke(2e-3), poke(4e-3)]), GRID)[-1]
    body = Body.of(BLOCK, NODES)
    assert np.allclose(
        body.surface(frame.move(body.rest)), supersampled(frame, SETUP.surface()), atol=1e-12
    )


def test_top_is_the_upper_layer_of_the_block():
    body = Body.of(BLOCK, NODES)
    top = body.over(BLOCK)
    assert top.grid == NODES[:2]
    assert top.flat
    assert np.allclose(top.rest, body.rest[top.index])
    assert np.allclose(top.rest[:, 2], SIZE[2])
    assert top.surface(top.rest).shape == (37 * 13, 3)
    assert np.allclose(top.voxel, body.voxel)


def test_edges_of_a_hexahedral_mesh_are_along_its_axes():
    grid = Body.of(BLOCK, NODES)
    mesh = Body.of_mesh(box_mesh(SIZE, GridSpec(nodes=NODES)))
    assert {tuple(pair) for pair in mesh.edges.T} == {tuple(pair) for pair in grid.edges.T}


@pytest.mark.parametrize("nodes", [(13, 5, 5), (25, 9, 9), (4, 3, 2)])
def test_shares_add_up_to_one(nodes):
    body = Body.of(BLOCK, nodes)
    assert np.allclose(body.shares.sum(axis=1), 1.0)
    assert np.allclose(body.surface(body.rest).max(axis=0), body.rest.max(axis=0))


def test_body_survives_a_file():
    body = Body.of(BLOCK, (4, 3, 2))
    again = Body.from_arrays(body.to_arrays())
    assert again.grid == body.grid
    assert np.array_equal(again.corners, body.corners)


def test_body_without_a_grid_has_no_top_layer():
    with pytest.raises(CorrectionError, match="top layer"):
        Body.of_mesh(box_mesh(SIZE, GridSpec(nodes=(4, 3, 2)))).over(BLOCK)


def test_surface_of_tetrahedra_excludes_the_base():
    mesh = filled_box(SIZE, 0.012)
    body = Body.of_mesh(mesh)
    places, hull = body.surface(body.rest), mesh.connectivity.hull
    assert body.grid is None
    assert np.isin(
        hull[~np.isin(hull, mesh.connectivity.base_nodes).all(axis=1)], body.corners
    ).all()
    on_base = np.isclose(places[:, 2], 0.0)
    rim = np.isclose(np.abs(places[:, :2]), np.array(SIZE[:2]) / 2).any(axis=1)
    assert (rim | ~on_base).all()
    assert len(np.unique(places.round(9), axis=0)) == len(places)


def test_surface_of_a_dome_is_sampled_where_it_is_and_follows_the_grid():
    shape = dome((0.04, 0.03, 0.025))
    body = Body.of(shape, (7, 6, 5))
    places = body.surface(body.rest)
    assert body.count == 7 * 6 * 5 and len(places) == len(body.rest) - body.count
    assert np.allclose(shape.facing(places)[0], 0.0, atol=1e-9)
    # A linear field of the grid is that field on the surface.
    assert np.allclose(body.carry(body.rest[: body.count]), body.rest, atol=1e-12)
    counts = np.arange(len(body.rest), dtype=float)
    assert body.gather(counts).sum() == pytest.approx(counts.sum())


def test_grid_over_a_dome_shares_the_sampled_surface_with_the_grid_through_it():
    shape = dome((0.04, 0.03, 0.025))
    body = Body.of(shape, (7, 6, 5))
    top = body.over(shape)
    assert top.grid == (7, 6) and top.flat and top.count == 42
    sampled = np.zeros((max(body.index.max(), top.index.max()) + 1, 3))
    sampled[top.index], sampled[body.index] = top.rest, body.rest
    assert np.allclose(sampled[top.index], top.rest, atol=2e-9)
    assert len(sampled) <= len(body.rest) + 42
    assert np.allclose(top.carried.sum(axis=1), 1.0, atol=1e-3)
    again = Body.from_arrays(top.to_arrays())
    assert np.array_equal(again.carriers, top.carriers) and again.count == 42


def test_vertical_sides_are_no_part_of_the_surface_over_the_top():
    shape = Shape(*box_surface(SIZE))
    body = Body.of(shape, NODES)
    top = body.over(shape)
    assert np.allclose(top.surface(top.rest)[:, 2], SIZE[2], atol=1e-6)
    assert len(top.corners) < 0.5 * len(body.corners)
