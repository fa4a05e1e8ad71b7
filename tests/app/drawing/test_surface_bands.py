from __future__ import annotations

import numpy as np
import pytest

from palpate.app.drawing.surface_bands import grid_edges, refine
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.mesh.box_mesh import GridSpec, box_mesh

SIZE = (0.06, 0.04, 0.03)


def block() -> tuple[FloatArray, IntArray]:
    mesh = box_mesh(SIZE, GridSpec(nodes=(5, 4, 3)))
    quads = mesh.free_surface
    return mesh.nodes, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def area(points: FloatArray, faces: IntArray) -> float:
    a, b, c = (points[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


@pytest.mark.parametrize("parts", [1, 2, 4])
def test_refined_surface_covers_the_same_area_with_parts_squared_triangles(parts: int) -> None:
    nodes, faces = block()
    fine = refine(nodes, faces, parts)
    assert len(fine.faces) == parts**2 * len(faces)
    assert area(fine.spread(nodes), fine.faces) == pytest.approx(area(nodes, faces))


def test_refined_triangles_look_outwards_as_the_coarse_ones_do() -> None:
    nodes, faces = block()
    fine = refine(nodes, faces, 3)
    points = fine.spread(nodes)
    a, b, c = (points[fine.faces[:, k]] for k in range(3))
    outwards = (a + b + c) / 3 - np.array([0.0, 0.0, SIZE[2] / 2])
    assert np.all(np.einsum("ij,ij->i", np.cross(b - a, c - a), outwards) > 0)


def test_points_are_shared_within_a_side_and_split_at_the_edges_of_the_box() -> None:
    nodes, faces = block()
    fine = refine(nodes, faces, 2)
    sides = [(9, 7), (9, 5), (9, 5), (7, 5), (7, 5)]
    assert len(fine.spread(nodes)) == sum(n * m for n, m in sides)


def test_spread_leaves_unseen_corners_out_and_stays_unseen_where_they_dominate() -> None:
    fine = refine(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]), 4)
    values = fine.spread(np.array([1.0, 3.0, np.nan]))
    along = np.isclose(fine.weights[:, 2], 0)
    np.testing.assert_allclose(values[along], 1.0 + 2.0 * fine.weights[along, 1])
    np.testing.assert_array_equal(np.isnan(values), fine.weights[:, 2] > 0.5)


def test_grid_edges_are_those_of_the_quadrilaterals() -> None:
    nodes, faces = block()
    edges = grid_edges(nodes, faces)
    steps = np.count_nonzero(np.abs(np.diff(nodes[edges], axis=1)[:, 0]) > 1e-9, axis=1)
    np.testing.assert_array_equal(steps, 1)
    top, front, left = 5 * 3 + 4 * 4, 5 * 2 + 4 * 3, 4 * 2 + 3 * 3
    shared = 2 * (4 + 3) + 4 * 2
    assert len(edges) == top + 2 * front + 2 * left - shared
