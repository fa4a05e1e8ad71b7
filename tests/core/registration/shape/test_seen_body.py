"""Rays against a body, and the points nearest to others."""

from __future__ import annotations

import numpy as np

from palpate.registration.shape.seen_body import SeenBody
from palpate.setup.box import Box

BODY = SeenBody(Box(size=(0.06, 0.04, 0.03)))
DOWN = np.array([0.0, 0.0, -1.0])


def test_rays_from_above_meet_the_top_or_miss() -> None:
    origins = np.array([[0.0, 0.0, 0.1], [0.029, 0.019, 0.1], [0.031, 0.0, 0.1]])
    hits = BODY.cast(origins, np.tile(DOWN, (3, 1)))
    assert hits.met.tolist() == [True, True, False]
    assert np.allclose(hits.distance[:2], 0.07) and np.allclose(hits.normal[:2], -DOWN)
    assert np.isinf(hits.distance[2]) and not hits.normal[2].any()


def test_ray_that_meets_the_surface_from_inside_misses() -> None:
    hits = BODY.cast(np.array([0.0, 0.0, -0.1]), -DOWN[None])
    assert not hits.met.any()


def test_nearest_points_lie_on_the_free_surface() -> None:
    places, normals = BODY.nearest(np.array([[0.05, 0.0, 0.015], [0.0, 0.0, 0.05]]))
    assert np.allclose(places, [[0.03, 0.0, 0.015], [0.0, 0.0, 0.03]], atol=1e-7)
    assert np.allclose(normals, [[1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def test_middle_of_what_is_seen_is_on_the_near_side() -> None:
    assert np.allclose(BODY.seen_from(-DOWN, 0.3), [0.0, 0.0, 0.03], atol=1e-3)
    beside = BODY.seen_from(np.array([1.0, 0.0, 0.0]), 0.3)
    assert abs(beside[0] - 0.03) < 1e-4 and abs(beside[1]) < 1e-3
