from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from palpate.diagnosis.design.profile_likelihood import combination, profile, vague
from palpate.effects import Parameter
from palpate.foundation.arrays import FloatArray

RATIO = Parameter(name="stiffness_ratio", unit="1", low=0.02, high=50.0, scale=0.5, log=True)
RADIUS = Parameter(name="radius", unit="m", low=2e-3, high=2e-2, scale=0.25, log=True)
EXTENT = Parameter(name="extent", unit="m", low=0.0, high=0.04, scale=2e-3)
AT, SURE = np.array([1.0, -5.0]), np.array([[0.16, 0.0], [0.0, 0.01]])


def _parabola(coordinates: FloatArray) -> float:
    return float(-0.5 * ((coordinates - AT) ** 2 / np.diag(SURE)).sum())


def _saturating(sign: float) -> Callable[[FloatArray], float]:
    """Falls as a parabola on one side and stays within a nat on the other."""

    def evidence(coordinates: FloatArray) -> float:
        away = sign * (coordinates[0] - AT[0]) / 0.4
        return float(-0.5 * away**2 if away < 0 else np.exp(-away) - 1.0)

    return evidence


def test_parabola_is_an_interval_after_a_look_to_each_side():
    found = profile(_parabola, AT, SURE, 0, RATIO)
    assert (found.told, found.evaluations) == ("interval", 2)


@pytest.mark.parametrize(("sign", "told"), [(1.0, "at least"), (-1.0, "at most")])
def test_side_that_does_not_fall_is_open(sign, told):
    assert profile(_saturating(sign), AT, SURE, 0, RATIO).told == told


def test_parameter_that_changes_nothing_is_not_identifiable():
    assert profile(lambda coordinates: 3.0, AT, SURE, 0, RATIO).told == "not identifiable"


def test_fall_that_comes_late_still_closes_the_side():
    late = profile(
        lambda coordinates: float(-max(0.0, abs(coordinates[0] - AT[0]) / 0.4 - 3.0)),
        AT,
        SURE,
        0,
        RATIO,
    )
    assert (late.told, late.evaluations) == ("interval", 4)


def test_others_are_moved_along_so_that_a_ridge_is_seen_as_one():
    tied = np.array([[0.16, -0.16], [-0.16, 0.1601]])

    def ridge(coordinates: FloatArray) -> float:
        return float(-0.5 * 1e4 * (coordinates - AT).sum() ** 2)

    assert profile(ridge, AT, tied, 0, RATIO).told == "not identifiable"
    assert (
        combination(tied, [RATIO, RADIUS], 0)
        == "the data look the same while stiffness_ratio grows and radius falls"
    )
    assert combination(SURE, [RATIO, RADIUS], 0) == ""


def test_bound_of_the_parameter_is_the_farthest_that_is_looked_at():
    seen: list[float] = []

    def evidence(coordinates: FloatArray) -> float:
        seen.append(float(coordinates[0]))
        return 0.0

    assert (
        profile(evidence, np.array([0.03]), np.array([[1e-4]]), 0, EXTENT).told
        == "not identifiable"
    )
    assert min(seen) == pytest.approx(0.0) and max(seen) == pytest.approx(0.04) and len(seen) == 4


def test_direction_is_looked_at_as_far_as_half_a_turn():
    seen: list[float] = []
    axis = Parameter(name="direction", unit="rad", low=0.0, high=np.pi, scale=0.3, periodic=True)

    def evidence(coordinates: FloatArray) -> float:
        seen.append(float(coordinates[0]))
        return 0.0

    profile(evidence, np.array([0.1]), np.array([[1.0]]), 0, axis)
    assert min(seen) == pytest.approx(0.1 - np.pi / 2) and max(seen) == pytest.approx(
        0.1 + np.pi / 2
    )


def test_only_what_the_linearised_fit_does_not_know_is_looked_at():
    assert vague(SURE, [RATIO, RADIUS]) == [0]
    assert vague(np.diag([0.01, 0.04]), [RATIO, RADIUS]) == [1]
    assert vague(1e-4 * np.eye(2), [RATIO, RADIUS]) == []
