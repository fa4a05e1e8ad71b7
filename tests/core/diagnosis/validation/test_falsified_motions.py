from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import SETUP, TOP, observed, poke

from palpate.diagnosis.observation.frame_groups import Observations
from palpate.diagnosis.validation.falsified_motions import FALSIFIED, mirrored, shifted, swapped
from palpate.foundation.frames import Transform

PLACES = [(0.018, 4e-3), (-0.012, -8e-3), (2e-3, 9e-3)]
DEPTHS = [-2e-2, -2e-2, -2e-2, 2e-3, 4e-3, 2e-3, -2e-2, -2e-2]


@pytest.fixture(scope="module")
def data() -> list[Observations]:
    """Three pokes in the middle of their recordings, each at its own place."""
    ways = [np.array([poke(depth, *place) for depth in DEPTHS]) for place in PLACES]
    made = [observed(SETUP, way, count=300, noise=0.0) for way in ways]
    return [replace(item, name=f"poke-{number:02d}") for number, item in enumerate(made)]


def _depths(item: Observations) -> np.ndarray:
    return np.maximum(TOP + SETUP.tool.radius - item.centres(SETUP)[:, 2], 0.0)


def test_shifted_clock_moves_pushes_to_where_there_were_none(data):
    for true, false in zip(data, shifted(data, SETUP), strict=True):
        assert _depths(false).max() > 0.5 * _depths(true).max()
        assert _depths(false) @ _depths(true) < 0.05 * np.linalg.norm(
            _depths(false)
        ) * np.linalg.norm(_depths(true))


def test_mirrored_tool_goes_as_deep_at_the_other_end(data):
    for true, false in zip(data, mirrored(data, SETUP), strict=True):
        np.testing.assert_allclose(
            false.centres(SETUP), true.centres(SETUP) * [-1, -1, 1], atol=1e-12
        )


def test_mirror_is_in_the_phantom_frame_whatever_the_robot_frame(data):
    turned = Transform.from_vector([0.1, -0.2, 0.05], [0.3, 0.2, -0.5])
    setup = replace(SETUP, phantom_from_robot=turned)
    stream = data[0].kinematics
    item = replace(
        data[0], kinematics=replace(stream, position=turned.inverse().apply(stream.position))
    )
    np.testing.assert_allclose(
        mirrored([item], setup)[0].centres(setup), data[0].centres(SETUP) * [-1, -1, 1], atol=1e-12
    )


def test_swapped_tools_follow_one_anothers_path(data):
    ways = swapped(data, SETUP)
    for true, false in zip(data, ways, strict=True):
        gone = [
            np.allclose(false.centres(SETUP), other.centres(SETUP), atol=1e-5)
            for other in data
            if other is not true
        ]
        assert sum(gone) == 1


@pytest.mark.parametrize("name", FALSIFIED)
def test_clouds_stay_as_they_were(data, name):
    for true, false in zip(data, FALSIFIED[name](data, SETUP), strict=True):
        assert all(
            there.points is here.points
            for here, there in zip(true.groups, false.groups, strict=True)
        )
        assert false.times is true.times and len(false.kinematics.time) == len(true.kinematics.time)
