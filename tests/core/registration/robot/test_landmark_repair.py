from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.registration.robot.landmark_repair import find_repairs, pairings_for, resized_repair
from palpate.setup.box import Box
from palpate.setup.setup import PAIRINGS, Touching

SIZE = (0.0687, 0.0393, 0.0358)
BLOCK = Box(size=SIZE)
CORNERS = np.array(
    [[x * SIZE[0] / 2, y * SIZE[1] / 2, SIZE[2]] for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
)
POSE = Transform.from_vector([0.1, -0.2, 0.3], [0.4, -1.1, 0.7])
"""phantom_from_robot"""
STARTS = POSE.inverse().apply(np.array([[0.0, 0.0, 0.055], [0.01, 0.03, 0.05], [-0.02, 0.0, 0.06]]))


def _touches(
    pairing: str = "as-paired", scale: float = 1.0, inset: float = 0.0, seed: int = 0
) -> FloatArray:
    places = CORNERS[Touching(pairing=pairing).order(4)]
    middle = CORNERS.mean(axis=0)
    places = middle + scale * (places - middle)
    places[:, :2] -= inset * np.sign(places[:, :2])
    return POSE.inverse().apply(
        places + 2.5e-4 * np.random.default_rng(seed).standard_normal((4, 3))
    )


def _off(fit: Transform) -> float:
    """Largest distance of corners from their true places [m]."""
    return float(np.linalg.norm((fit @ POSE.inverse()).apply(CORNERS) - CORNERS, axis=1).max())


@pytest.mark.parametrize("seed", range(10))
def test_right_touches_stay_as_they_are(seed: int):
    assert find_repairs(_touches(seed=seed), CORNERS, BLOCK, STARTS) == ()


@pytest.mark.parametrize(
    "pairing", ["swap-1-2", "swap-1-3", "swap-2-3", "swap-2-4", "turn-1", "turn-3", "reversed"]
)
def test_robot_is_found_where_it_is_though_corners_were_swapped_and_the_polygon_is_small(
    pairing: str,
):
    found = find_repairs(_touches(pairing, 0.86, 1e-3), CORNERS, BLOCK, STARTS)
    right = [one for one in found if one.pairing == pairing]
    assert right and _off(right[0].fit.phantom_from_robot) < 6e-4
    assert right[0].scale == pytest.approx(0.82, abs=0.03) and right[0].fit.sigma < 1e-3
    # What fits as well is the same rectangle half a turn about.
    half = Transform(np.diag([-1.0, -1.0, 1.0]))
    assert all(
        min(_off(one.fit.phantom_from_robot), _off(half @ one.fit.phantom_from_robot)) < 6e-4
        for one in found
    )


def test_polygon_of_another_size_alone_moves_nothing_and_is_known_better():
    touches = _touches(scale=0.86)
    assert find_repairs(touches, CORNERS, BLOCK, STARTS) == ()
    found = resized_repair(touches, CORNERS)
    assert found.pairing == "as-paired" and found.scale == pytest.approx(0.86, abs=0.01)
    assert _off(found.fit.phantom_from_robot) < 6e-4 and found.fit.sigma < 5e-4


def test_three_touches_have_fewer_pairings():
    assert pairings_for(4) == PAIRINGS
    assert pairings_for(3) == (
        "as-paired",
        "swap-1-2",
        "swap-1-3",
        "swap-2-3",
        "turn-1",
        "turn-2",
        "reversed",
    )
