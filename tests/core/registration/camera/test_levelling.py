from __future__ import annotations

import numpy as np
from small_dataset import SIZE

from palpate.foundation.frames import Transform
from palpate.registration.camera.levelling import as_seen, levelled

POSE = Transform.from_vector([0.01, -0.2, 0.3], [-2.3, 0.15, 0.1])
"""phantom_from_camera"""


def cloud(noise=0.0005):
    rng = np.random.default_rng(1)
    table = np.column_stack([rng.uniform(-0.12, 0.12, (3000, 2)), np.zeros(3000)])
    table = table[(np.abs(table[:, 0]) > SIZE[0] / 2) | (np.abs(table[:, 1]) > SIZE[1] / 2)]
    top = np.column_stack([rng.uniform(-0.5, 0.5, (1500, 2)) * SIZE[:2], np.full(1500, SIZE[2])])
    points = np.concatenate([table, top])
    return POSE.inverse().apply(points + rng.normal(0, noise, points.shape)), points


def test_the_table_lies_flat_and_the_camera_stands_in_front_of_it():
    seen, true = cloud()
    shown = levelled(seen).apply(seen)
    assert np.abs(shown[:, 2] - true[:, 2]).max() < 4e-3
    camera = levelled(seen).translation
    assert camera[2] > 0.1 and camera[1] < -0.05 and abs(camera[0]) < 0.06
    assert np.linalg.norm(np.median(shown[true[:, 2] > 0.01], axis=0)[:2]) < 5e-3


def test_a_cloud_without_any_plane_is_shown_as_the_camera_sees_it():
    rng = np.random.default_rng(0)
    ball = rng.normal(0, 0.2, (500, 3)) + np.array([0, 0, 2.0])
    assert np.allclose(levelled(ball).rotation, as_seen(ball).rotation)
    assert abs(np.median(as_seen(ball).apply(ball)[:, 0])) < 1e-9
