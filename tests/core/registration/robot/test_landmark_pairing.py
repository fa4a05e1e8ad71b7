from __future__ import annotations

import numpy as np
import pytest

from palpate.foundation.frames import Transform
from palpate.registration.robot.landmark_pairing import propose_pairing
from palpate.setup.box import Box

BLOCK = Box(size=(0.0687, 0.0393, 0.0358))
NAMES = ("corner_0", "corner_1", "corner_2", "corner_3")
PLACES = dict(
    zip(NAMES, np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) * [0.03435, 0.01965], strict=True)
)
EXPECTED = {name: np.array([x, y, 0.0358]) for name, (x, y) in PLACES.items()}
POSE = Transform.from_vector([0.1, -0.2, 0.3], [0.4, -1.1, 0.7])
STARTS = np.array([[0.0, 0.0, 0.05], [0.01, 0.03, 0.04], [-0.02, 0.0, 0.055]])


def touches(scale: float = 1.0, noise: float = 2.5e-4, seed: int = 0) -> np.ndarray:
    corners = np.array([EXPECTED[name] for name in NAMES])
    shrunk = corners.mean(axis=0) + scale * (corners - corners.mean(axis=0))
    return POSE.inverse().apply(shrunk + np.random.default_rng(seed).normal(0, noise, (4, 3)))


@pytest.mark.parametrize("seed", range(20))
def test_right_touches_give_no_proposal(seed: int):
    assert (
        propose_pairing(NAMES, touches(seed=seed), EXPECTED, BLOCK, POSE.inverse().apply(STARTS))
        is None
    )


def test_two_swapped_corners_are_noticed_with_numbers():
    stated = ("corner_0", "corner_1", "corner_3", "corner_2")
    found = propose_pairing(stated, touches(), EXPECTED, BLOCK, POSE.inverse().apply(STARTS))
    assert found is not None
    assert found.pairing == NAMES
    assert found.rms_as_stated > 0.02
    assert found.rms_proposed < 5e-4
    assert (
        "row 3 corner_3 -> corner_2" in found.sentence
        and "mm" in found.sentence
        and "%" in found.sentence
    )


def test_a_pairing_turned_by_half_a_turn_is_equal_and_so_not_better():
    assert (
        propose_pairing(
            ("corner_2", "corner_3", "corner_0", "corner_1"), touches(), EXPECTED, BLOCK
        )
        is None
    )


@pytest.mark.parametrize("shift", [1, 3])
def test_a_shifted_order_is_noticed(shift: int):
    stated = NAMES[shift:] + NAMES[:shift]
    found = propose_pairing(stated, touches(), EXPECTED, BLOCK)
    assert found is not None and found.rms_proposed < 5e-4 < found.rms_as_stated


def test_a_mirrored_order_that_fits_upside_down_is_noticed_by_where_the_tool_would_be():
    mirrored = ("corner_1", "corner_0", "corner_3", "corner_2")
    assert propose_pairing(mirrored, touches(), EXPECTED, BLOCK) is None
    found = propose_pairing(mirrored, touches(), EXPECTED, BLOCK, POSE.inverse().apply(STARTS))
    assert found is not None
    assert found.pairing == NAMES
    assert "inside the phantom or under the table" in found.sentence


@pytest.mark.parametrize(("scale", "word"), [(0.88, "smaller"), (1.12, "larger")])
def test_a_polygon_of_another_size_is_measured_in_percent(scale: float, word: str):
    found = propose_pairing(NAMES, touches(scale=scale), EXPECTED, BLOCK)
    assert found is not None
    assert found.pairing == NAMES
    assert found.scale == pytest.approx(scale, abs=0.01)
    assert word in found.sentence and "%" in found.sentence
    assert found.rms_proposed < 0.2 * found.rms_as_stated


def test_swapped_and_shrunken_touches_are_both_reported():
    stated = ("corner_1", "corner_0", "corner_2", "corner_3")
    found = propose_pairing(stated, touches(scale=0.85, noise=8e-4), EXPECTED, BLOCK)
    assert found is not None
    assert found.scale == pytest.approx(0.85, abs=0.04)
    assert "wrong landmarks" in found.sentence and "smaller" in found.sentence


def test_one_percent_is_within_what_touching_can_do_and_is_not_reported():
    assert propose_pairing(NAMES, touches(scale=0.99, noise=1e-4), EXPECTED, BLOCK) is None


def test_more_than_six_landmarks_are_searched_by_swaps_and_shifts():
    ring = [
        np.array(
            [
                0.03 * np.cos(a),
                0.02 * np.sin(a) + 0.004 * np.sin(3 * a),
                0.036 + 0.002 * np.cos(5 * a),
            ]
        )
        for a in np.arange(8) * np.pi / 4
    ]
    expected = {f"mark_{k}": place for k, place in enumerate(ring)}
    names = list(expected)
    points = POSE.inverse().apply(np.array(ring) + np.random.default_rng(0).normal(0, 2e-4, (8, 3)))
    swapped = [names[k] for k in (0, 1, 5, 3, 4, 2, 6, 7)]
    shifted = names[3:] + names[:3]
    for stated in (swapped, shifted):
        found = propose_pairing(stated, points, expected, BLOCK, POSE.inverse().apply(STARTS))
        assert found is not None and found.pairing == tuple(names)
