"""The grid through the bounds of a body and the one over its top, on a block and on others."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import cut_ball, dome

from palpate.correction.samples.embedding_grid import EmbeddingGrid, seen_from_above
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import CorrectionError
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.setup.box import Box

SIZE, NODES = (0.0687, 0.0393, 0.0358), (13, 5, 5)
BLOCK, DOME = Box(size=SIZE), dome((0.04, 0.03, 0.025))


def _value(grid: EmbeddingGrid, values: FloatArray, places: FloatArray) -> FloatArray:
    points, shares = grid.between(places)
    return np.asarray((shares * values[points]).sum(axis=1))


def _linear(places: FloatArray) -> FloatArray:
    return np.asarray(places @ [0.3, -0.2, 0.5] + 0.1)


def test_linear_field_is_reproduced_all_over_the_surface_of_a_body():
    grid = EmbeddingGrid(DOME, (7, 6, 5))
    places = DOME.surface_points()
    np.testing.assert_allclose(
        _value(grid, _linear(grid.points), places), _linear(places), atol=1e-12
    )
    np.testing.assert_allclose(np.ptp(grid.points, axis=0), DOME.size, atol=1e-12)


def test_value_over_the_top_holds_on_a_slope_and_fades_within_a_voxel_below():
    grid = EmbeddingGrid(DOME, (7, 6, 5), flat=True)
    places = DOME.surface_points()
    level = grid.points @ [0.3, -0.2, 0.0]
    np.testing.assert_allclose(_value(grid, level, places), places @ [0.3, -0.2, 0.0], atol=1e-5)
    depth = np.array([0.0, 0.25, 0.5, 1.0, 1.5]) * grid.voxel[2]
    below = np.column_stack([np.full((5, 2), 2e-3), DOME.heights(np.full((5, 2), 2e-3)) - depth])
    found = _value(grid, np.ones(len(grid.points)), below)
    np.testing.assert_allclose(found, [1.0, 0.75, 0.5, 0.0, 0.0], atol=1e-6)


@pytest.mark.parametrize("flat", [False, True])
def test_values_in_a_block_are_those_of_its_mesh_of_hexahedra(flat):
    grid, rng = EmbeddingGrid(BLOCK, NODES, flat), np.random.default_rng(0)
    values = rng.normal(size=len(grid.points))
    mesh = box_mesh(SIZE, GridSpec(nodes=NODES))
    everywhere = np.zeros(len(mesh.nodes))
    everywhere[-len(values) :] = values
    places = rng.uniform(BLOCK.low, BLOCK.high, (200, 3))
    expected = mesh.interpolate(everywhere[:, None], places)[:, 0]
    np.testing.assert_allclose(_value(grid, values, places), expected, atol=1e-12)
    assert np.array_equal(grid.points, mesh.nodes[-len(values) :])


def test_overhang_is_not_seen_from_above():
    ball = cut_ball(0.015, 0.01)
    places = ball.surface_points()
    seen = seen_from_above(ball, places)
    assert seen[places[:, 2] > 0.0125].all() and not seen[places[:, 2] < 0.0085].any()


def test_only_a_block_lies_in_the_faces_of_its_grid():
    for body, expected in ((BLOCK, True), (DOME, False)):
        grid = EmbeddingGrid(body, NODES)
        assert grid.holds(body.surface_points((5, 4, 3))) is expected


@pytest.mark.parametrize("nodes", [(13, 5), (13, 1, 5)])
def test_grid_without_cells_is_refused(nodes):
    with pytest.raises(CorrectionError, match="two points or more"):
        EmbeddingGrid(BLOCK, nodes)
