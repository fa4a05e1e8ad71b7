from __future__ import annotations

import numpy as np

from palpate.registration.pose import motion_jacobian, small_motion


def test_jacobian_of_a_small_motion_agrees_with_finite_differences():
    rng = np.random.default_rng(1)
    points, pivot = rng.normal(0, 0.05, (7, 3)), np.array([0.01, -0.02, 0.03])
    step = 1e-7
    differences = np.stack(
        [(small_motion(step * unit, pivot).apply(points) - points) / step for unit in np.eye(6)],
        axis=-1,
    )
    np.testing.assert_allclose(motion_jacobian(points, pivot), differences, atol=1e-8)


def test_a_rotation_about_the_pivot_leaves_the_pivot_where_it_is():
    pivot = np.array([0.01, 0.02, 0.03])
    np.testing.assert_allclose(
        small_motion(np.array([0, 0, 0, 0.3, -0.2, 0.5]), pivot).apply(pivot), pivot, atol=1e-15
    )
