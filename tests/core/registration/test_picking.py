from __future__ import annotations

import numpy as np

from benchmarks.picking import aimed_and_picked
from palpate.registration.picking import pick_cloud, pick_mesh, slide_on_cloud


def test_on_a_noisy_slanted_cloud_the_median_pick_is_within_three_tenths_of_a_millimetre():
    aimed, picked = aimed_and_picked(clicks=200)
    assert np.isfinite(picked).all()
    assert np.median(np.linalg.norm(aimed - picked, axis=1)) < 3e-4


def test_the_front_surface_is_picked_though_one_behind_is_nearer_to_the_ray():
    points = np.array([[0.0002, 0.0, 0.2], [0.0, 0.0, 0.3]])
    assert pick_cloud(points, np.zeros(3), np.array([0.0, 0.0, 1.0]), pixel=0.001) == 0


def test_of_one_surface_the_point_nearest_to_the_ray_is_picked():
    points = np.array([[0.0002, 0.0, 0.2], [0.0001, 0.0, 0.2005], [0.0, 0.0, -0.2]])
    assert pick_cloud(points, np.zeros(3), np.array([0.0, 0.0, 2.0]), pixel=0.001) == 1


def test_a_click_beside_the_cloud_picks_nothing():
    assert (
        pick_cloud(
            np.array([[0.1, 0.0, 0.2], [0.0, 0.0, -0.2]]),
            np.zeros(3),
            np.array([0.0, 0.0, 1.0]),
            pixel=0.001,
        )
        is None
    )


def test_a_ray_meets_the_nearest_triangle_and_its_edges():
    vertices = np.array(
        [[0, 0, 1], [1, 0, 1], [0, 1, 1], [0, 0, 2], [1, 0, 2], [0, 1, 2]], dtype=float
    )
    faces = np.array([[3, 4, 5], [0, 2, 1]])
    up = np.array([0.0, 0.0, 1.0])
    for start, place in (([0.2, 0.3, 0.0], 1.0), ([0.0, 0.0, 0.0], 1.0), ([0.2, 0.3, 1.5], 2.0)):
        met = pick_mesh(vertices, faces, np.array(start), up)
        assert met is not None and np.allclose(met, [start[0], start[1], place])
    assert pick_mesh(vertices, faces, np.array([0.8, 0.8, 0.0]), up) is None
    assert pick_mesh(vertices, faces, np.array([0.2, 0.3, 3.0]), up) is None


def test_a_pick_slides_on_the_surface_by_less_than_the_points_are_apart():
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 51), np.linspace(-0.05, 0.05, 51))
    slanted = np.column_stack([x.ravel(), y.ravel(), 0.3 + 0.5 * y.ravel()])
    aim = np.array([0.0103, 0.0057, 0.3 + 0.5 * 0.0057])
    moved = slide_on_cloud(slanted, slanted[1300], np.zeros(3), aim)
    assert moved is not None and np.allclose(moved, aim, atol=1e-9)
    assert slide_on_cloud(slanted, slanted[1300], np.zeros(3), np.array([0.0, 2.0, 1.0])) is None
