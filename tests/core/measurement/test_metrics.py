from __future__ import annotations

import numpy as np
import pytest
from pushed_block import GRID, SETUP, SIZE, TOP, poke

from palpate.measurement.metrics import PAPER_GRID, paper_distance, supersampled
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.replay.replay import Equilibrium, replay, rest

SURFACE = SETUP.surface()


@pytest.fixture(scope="module")
def dented() -> Equilibrium:
    """The block under a ball pressed in by 4 mm."""
    return replay(SETUP, np.array([poke(2e-3), poke(4e-3)]), GRID)[-1]


def test_supersampled_vertices_are_those_of_the_free_surface_of_37x13x13(dented):
    # All nodes but those inside, and but those inside the base.
    wanted = 37 * 13 * 13 - 35 * 11 * 12
    assert supersampled(dented, SURFACE).shape == (wanted, 3)


def test_supersampled_vertices_at_rest_lie_on_the_box():
    points = supersampled(rest(SETUP, GridSpec()), SURFACE)
    on_side = np.isclose(np.abs(points[:, :2]), np.array(SIZE[:2]) / 2, atol=1e-12).any(axis=1)
    assert (on_side | np.isclose(points[:, 2], TOP, atol=1e-12)).all()
    assert len(np.unique(points.round(9), axis=0)) == len(points)


def test_supersampled_vertices_are_linear_between_the_papers_nodes(dented):
    found = supersampled(dented, SURFACE)
    coarse = box_mesh(SIZE, PAPER_GRID)
    corners = np.unique(coarse.free_surface)
    moved = dented.move(coarse.nodes)
    nearest = np.linalg.norm(found[:, None] - moved[corners], axis=2).min(axis=0)
    assert nearest.max() < 1e-12
    # A third of the way along an edge of the top, between neighbours in x.
    quad = coarse.faces["+z"][20]
    third = moved[quad[0]] + (moved[quad[1]] - moved[quad[0]]) / 3
    assert np.linalg.norm(found - third, axis=1).min() < 1e-12


def test_paper_distance_is_the_mean_distance_to_the_nearest_vertex(dented):
    points = np.random.default_rng(0).uniform([-0.04, -0.02, 0.0], [0.04, 0.02, 0.04], (300, 3))
    vertices = supersampled(dented, SURFACE)
    wanted = np.mean([np.linalg.norm(vertices - point, axis=1).min() for point in points])
    assert paper_distance(points, dented, SURFACE) == pytest.approx(wanted, rel=1e-12)


def test_paper_distance_of_the_vertices_themselves_is_zero_and_of_nothing_unknown(dented):
    assert paper_distance(supersampled(dented, SURFACE), dented, SURFACE) == 0.0
    assert np.isnan(paper_distance(np.zeros((0, 3)), dented, SURFACE))
