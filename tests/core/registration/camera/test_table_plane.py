from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.errors import RegistrationError
from palpate.registration.camera.table_plane import find_planes, find_table


def test_the_table_is_found_even_where_the_block_fills_the_picture(scene):
    view = scene(strays=200).look(seed=1)
    heights = view.pose.apply(view.cloud)[:, 2]
    near = view.cloud[(heights > 0.01) | (np.arange(len(heights)) % 30 == 0)]
    planes = find_planes(near, 2e-3)
    table = find_table(near, 2e-3)
    assert max(plane.count for plane in planes) > table.count
    true_normal = view.pose.inverse().rotate(np.array([0.0, 0.0, 1.0]))
    assert np.degrees(np.arccos(table.normal @ true_normal)) < 0.5
    assert abs(table.height(view.pose.inverse().apply(np.zeros((1, 3))))[0]) < 5e-4


def test_a_cloud_without_planes_has_no_table():
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (400, 3))
    with pytest.raises(RegistrationError, match="a table was expected"):
        find_table(points, 1e-3)


def test_the_same_cloud_gives_the_same_planes_each_time(scene):
    cloud = scene(noise=2e-3, bias=1e-3).look(seed=4).cloud
    first = find_table(cloud, 4e-3)
    for _ in range(20):
        again = find_table(cloud, 4e-3)
        assert np.array_equal(again.normal, first.normal) and again.offset == first.offset
