"""Points of a cloud in manual registration: their brightness shows the relief, their size its
density.
"""

from __future__ import annotations

import numpy as np
import pytest

from palpate.app.scene.registration_scene import POINT_SIZES, by_height, size_of_points


def test_higher_points_are_brighter_and_stray_ones_do_not_darken_the_others() -> None:
    heights = np.concatenate([np.linspace(0.0, 0.03, 200), [5.0]])
    shades = by_height(heights).astype(int).sum(axis=1)
    assert (np.diff(shades[:200]) >= 0).all()
    assert shades[199] > 2 * shades[0]
    assert by_height(np.zeros(0)).shape == (0, 3)


@pytest.mark.parametrize(
    ("apart", "size"), [(1e-4, POINT_SIZES[0]), (8e-4, 4.8e-4), (0.01, POINT_SIZES[1])]
)
def test_points_are_the_smaller_the_denser_they_are(apart: float, size: float) -> None:
    x, y = np.meshgrid(apart * np.arange(40), apart * np.arange(40))
    points = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    assert size_of_points(points) == pytest.approx(size)
    assert size_of_points(points[:1]) == POINT_SIZES[1]
