"""Each question to a geometry has one answer for a block and for the same block as a surface."""

from __future__ import annotations

import numpy as np
import pytest
from shapes import box_surface, cut_ball

from palpate.setup.box import Box
from palpate.setup.free_form.shape import Shape
from palpate.setup.phantom_geometry import Geometry

SIZE = (0.0687, 0.0393, 0.0358)
X, Y, TOP = SIZE[0] / 2, SIZE[1] / 2, SIZE[2]


@pytest.fixture(params=["block", "surface"])
def body(request: pytest.FixtureRequest) -> Geometry:
    return Box(size=SIZE) if request.param == "block" else Shape(*box_surface(SIZE))


def test_bounds(body: Geometry) -> None:
    np.testing.assert_allclose(body.low, [-X, -Y, 0.0])
    np.testing.assert_allclose(body.high, [X, Y, TOP])
    assert body.size == pytest.approx(SIZE) and body.height == pytest.approx(TOP)
    assert body.volume == pytest.approx(np.prod(SIZE))


def test_distance_is_zero_inside(body: Geometry) -> None:
    points = np.array(
        [[0, 0, TOP / 2], [0, 0, TOP + 3e-3], [X + 3e-3, 0, TOP + 4e-3], [0, Y + 2e-3, 0.01]]
    )
    np.testing.assert_allclose(body.distance(points), [0, 3e-3, 5e-3, 2e-3], atol=1e-12)


def test_gap_is_the_distance_to_the_nearest_side_edge_or_corner(body: Geometry) -> None:
    points = np.array(
        [
            [0, 0, TOP + 0.012],
            [X + 0.007, 0, 0.02],
            [X + 0.003, Y + 0.004, 0.02],
            [0, 0, TOP - 0.002],
            [X - 0.001, 0, 0.02],
        ]
    )
    gaps = body.gap(points, 5e-3)
    np.testing.assert_allclose(gaps, [0.007, 0.002, 0.0, -0.007, -0.006], atol=1e-12)


def test_normals_are_those_of_the_nearest_side(body: Geometry) -> None:
    _, normals = body.facing(np.array([[0.01, 0.005, TOP + 2e-3], [-X + 1e-3, 0.002, 0.015]]))
    np.testing.assert_allclose(normals, [[0, 0, 1], [-1, 0, 0]], atol=1e-12)


def test_height_is_that_of_the_highest_point_of_a_column(body: Geometry) -> None:
    places = np.array([[0.0, 0.0], [0.9 * X, -0.9 * Y], [X + 0.01, 0.0]])
    np.testing.assert_allclose(body.heights(places), TOP, atol=1e-7)


def test_height_of_a_ball_is_that_above_its_overhang_and_beside_it_that_of_its_rim() -> None:
    radius, middle = 0.015, 0.01
    ball = cut_ball(radius, middle)
    across = np.array([0.0, 0.5, 0.9]) * radius
    expected = middle + np.sqrt(radius**2 - across**2)
    found = ball.heights(np.column_stack([across, np.zeros(3)]))
    np.testing.assert_allclose(found, expected, atol=3e-4)
    (beside,) = ball.heights(np.array([[0.05, 0.0]]))
    assert abs(beside - middle) < 2.5e-3


def test_points_of_a_grid_lie_on_the_free_faces_of_a_block_and_all_over_another_body() -> None:
    counts = (5, 4, 3)
    block = Box(size=SIZE).surface_points(counts)
    steps = (block - [-X, -Y, 0.0]) / SIZE * (np.array(counts) - 1)
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-12)
    assert len(block) == len(np.unique(steps.round(), axis=0)) == 5 * 4 + 2 * (5 + 2) * 2
    ball = cut_ball(0.015, 0.01)
    many = ball.surface_points((40, 30, 20))
    assert len(many) == 40 * 30 + 2 * (40 + 28) * 19 > len(ball.surface_points(counts))
    np.testing.assert_allclose(ball.facing(many)[0], 0.0, atol=1e-9)
