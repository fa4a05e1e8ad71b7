"""Share of a point's volume within a ball or a tube, against its distance from the surface."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest

from palpate.fem.constitutive.stiffness_field import log_stiffness, lump_share
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import SetupError
from palpate.setup.setup import Box, Inclusion, Material, Tube

EDGE, RADIUS = 2e-3, 3e-3
WAY = np.linspace(-0.05, 0.05, 21)
BENT = np.column_stack([WAY, 4.0 * WAY**2, 0.02 + 0.2 * WAY])


@dataclass(frozen=True, eq=False)
class Points:
    """Points with edges of one length."""

    places: FloatArray

    @property
    def edges(self) -> FloatArray:
        return np.full(self.places.shape[:-1], EDGE)


def _tube(line: FloatArray, ratio: float = 5.0) -> Tube:
    points = tuple((float(x), float(y), float(z)) for x, y, z in line)
    return Tube(polyline=points, radius=RADIUS, stiffness_ratio=ratio)


def _expected(apart: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (1 + np.tanh(2 * (RADIUS - apart) / EDGE)))


def _distance(places: FloatArray, line: FloatArray) -> FloatArray:
    """Distance [m] from a line through points, by brute force on 4000 points in all."""
    shares = np.linspace(0, 1, 4000 // (len(line) - 1))[:, None]
    dense = np.concatenate([one + shares * (other - one) for one, other in pairwise(line)])
    return np.array([np.linalg.norm(dense - place, axis=1).min() for place in places])


@pytest.mark.parametrize("line", [BENT[[0, -1]], BENT, BENT[::-1]], ids=["chord", "bent", "back"])
def test_share_in_a_tube_falls_with_the_distance_from_its_axis(line):
    places = np.random.default_rng(0).uniform([-0.06, -0.02, 0.0], [0.06, 0.02, 0.04], (400, 3))
    apart = _distance(places, line)
    assert (apart < RADIUS).any() and (apart > RADIUS + 3 * EDGE).any()
    share = lump_share(_tube(line), Points(places.reshape(20, 20, 3))).ravel()
    assert share == pytest.approx(_expected(apart), abs=2e-4)
    assert (share[apart > RADIUS + 2.4 * EDGE] == 0.0).all()


def test_tube_ends_round_like_a_ball():
    end = BENT[0]
    beyond = end + np.random.default_rng(1).uniform(-5e-3, 0.0, (200, 3)) * (1.0, 0.0, 1.0)
    beyond[:, 0] -= 1e-3
    ball = Inclusion(
        **dict(zip("xyz", end.tolist(), strict=True)), radius=RADIUS, stiffness_ratio=5.0
    )
    straight = np.array([end, end + np.array([0.05, 0.0, 0.0])])
    shares = [lump_share(lump, Points(beyond)) for lump in (ball, _tube(straight))]
    assert shares[0].max() > 0.5 and shares[1] == pytest.approx(shares[0])


def test_stiffness_within_a_tube_is_its_ratio_times_that_of_the_rest():
    body, ratio = Box(size=(0.2, 0.2, 0.04)), 5.0
    material = Material(inclusions=(_tube(BENT, ratio),))
    factor = np.exp(log_stiffness(material, Points(BENT[3:-3]), body))
    assert factor == pytest.approx(ratio, rel=0.01)
    assert np.exp(
        log_stiffness(material, Points(BENT + np.array([0.0, 0.0, 0.02])), body)
    ) == pytest.approx(1.0, rel=1e-3)


def test_line_of_one_point_is_no_tube():
    with pytest.raises(SetupError, match="has 1 points; state at least two"):
        Tube(polyline=((0.0, 0.0, 0.0),), radius=RADIUS, stiffness_ratio=2.0)
