"""Signed distances on a grid."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.setup.box import Box
from palpate.synthetic.bodies.shape_families import draw_shape


def test_distances_to_a_free_form_are_interpolated_to_a_fifth_of_a_millimetre() -> None:
    body = draw_shape("kidney", 0)
    random = np.random.default_rng(0)
    points = random.uniform(body.low - 0.015, body.high + 0.015, (300, 3))
    exact, _ = body.facing(points)
    apart = body.outside(points) - np.sign(exact) * np.abs(exact)
    assert np.abs(apart).max() < 0.4e-3 and np.sqrt((apart**2).mean()) < 0.2e-3


def test_far_points_are_farther_than_the_grid_reaches() -> None:
    body = draw_shape("dome", 0)
    far = np.array([[0.5, 0.0, 0.01], [0.0, 0.0, 1.0]])
    found = body.outside(far)
    assert (found > 0.4).all() and (np.abs(found - body.distance(far)) < 0.02).all()


def test_block_knows_its_distance_exactly() -> None:
    block = Box(size=(0.06, 0.04, 0.03))
    places = np.array([[0.0, 0.0, 0.04], [0.03, 0.02, 0.05], [0.0, 0.0, 0.02], [0.0, 0.0, -0.01]])
    assert np.allclose(block.outside(places), [0.01, 0.02, -0.01, 0.01])


def test_closed_surfaces_are_closed_and_turn_outwards() -> None:
    for body in (Box(size=(0.06, 0.04, 0.03)), draw_shape("liver", 0)):
        vertices, triangles = body.closed_surface
        a, b, c = vertices[triangles].transpose(1, 0, 2)
        assert np.einsum("ti,ti->", a, np.cross(b, c)) / 6 == pytest.approx(body.volume)
        ends = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        assert (np.unique(ends, axis=0, return_counts=True)[1] == 2).all()


def test_depth_below_a_skin_is_that_below_the_free_surface_alone() -> None:
    body = draw_shape("liver", 0)
    places, outwards = body.surface_points()[::40], 1e-6 * np.array([0.0, 0.0, 1.0])
    normals = body.facing(places + outwards)[1]
    high = places[:, 2] > 0.3 * body.height
    for depth in (0.5e-3, 2e-3, 4e-3):
        found = body.below_skin(places[high] - depth * normals[high])
        assert np.median(np.abs(found - depth)) < 0.05e-3 and np.abs(found - depth).max() < 0.5e-3
    over_base = np.array([[0.0, 0.0, 1e-3]])
    assert body.below_skin(over_base)[0] > 0.01
    block = Box(size=(0.06, 0.04, 0.03))
    assert block.below_skin(np.array([[0.0, 0.0199, 0.02]]))[0] == pytest.approx(0.01)
