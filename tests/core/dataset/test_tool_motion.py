"""Contacts of tool paths: kinds, depths, speeds and times."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from small_dataset import SIZE, write_valid_dataset

from palpate.dataset import Dataset, Kinematics, Sequence, open_dataset
from palpate.dataset.tool_motion import describe_motion
from palpate.dataset.tool_smoothing import SMOOTHING, averaged
from palpate.foundation.frames import Transform

TOP, RADIUS = SIZE[2], 0.005


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    return open_dataset(write_valid_dataset(tmp_path_factory.mktemp("motion") / "block"))


def moving(*corners: tuple[float, float, float], seconds: float = 2.0) -> Sequence:
    """A tool that goes straight from corner to corner (phantom frame), each leg in `seconds`, a
    cloud every 0.1 s.
    """
    ends = np.arange(len(corners)) * seconds
    time = np.arange(0, ends[-1], 0.002)
    path = np.stack(
        [np.interp(time, ends, [corner[axis] for corner in corners]) for axis in range(3)], axis=-1
    )
    noise = np.random.default_rng(1).normal(0, 5e-5, path.shape)
    turn = np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1))
    stamps = np.arange(0.05, ends[-1], 0.1)
    return Sequence(
        Path(), "made", Kinematics(time, path + noise, turn), stamps, ("",) * len(stamps), None
    )


def test_two_pushes_from_above_are_two_contacts_with_their_depths(dataset: Dataset) -> None:
    above = TOP + RADIUS + 0.01
    down = [(0.01, 0.0, above), (0.01, 0.0, TOP + RADIUS - 0.004), (0.01, 0.0, above)]
    again = [(-0.01, 0.0, above), (-0.01, 0.0, TOP + RADIUS - 0.007), (-0.01, 0.0, above)]
    motion = describe_motion(dataset, moving(*down, *again), Transform())
    assert [contact.kind for contact in motion.contacts] == ["top", "top"]
    np.testing.assert_allclose(
        [contact.depth for contact in motion.contacts], [0.004, 0.007], atol=4e-4
    )
    np.testing.assert_allclose(
        [contact.speed for contact in motion.contacts], [0.007, 0.0085], rtol=0.1
    )
    np.testing.assert_allclose(motion.contacts[1].place, [-0.01, 0.0, TOP + RADIUS], atol=1e-3)
    assert 12 <= motion.untouched_before <= 15


def test_a_push_from_the_side_and_a_drag_are_distinguished(dataset: Dataset) -> None:
    beside, into = (
        (SIZE[0] / 2 + RADIUS + 0.01, 0.0, 0.02),
        (SIZE[0] / 2 + RADIUS - 0.005, 0.0, 0.02),
    )
    side = describe_motion(dataset, moving(beside, into, beside), Transform())
    low = TOP + RADIUS - 0.004
    corners = [
        (-0.015, 0.0, TOP + 0.02),
        (-0.015, 0.0, low),
        (0.015, 0.0, low),
        (0.015, 0.0, TOP + 0.02),
    ]
    drag = describe_motion(dataset, moving(*corners), Transform())
    assert [contact.kind for contact in side.contacts] == ["side"]
    assert [contact.kind for contact in drag.contacts] == ["drag"]
    np.testing.assert_allclose(drag.contacts[0].travel, 0.03, atol=3e-4)


def test_a_tool_that_stays_away_has_no_contact_and_says_how_near_it_came(dataset: Dataset) -> None:
    motion = describe_motion(
        dataset, moving((0, 0, TOP + 0.03), (0, 0, TOP + 0.011), (0, 0, TOP + 0.03)), Transform()
    )
    assert motion.contacts == ()
    np.testing.assert_allclose(motion.nearest, 0.006, atol=3e-4)
    assert motion.untouched_before == 40


def test_the_registration_carries_the_path_into_the_phantom(dataset: Dataset) -> None:
    above, low = (0.005, -0.01, TOP + 0.02), (0.005, -0.01, TOP + RADIUS - 0.003)
    pose = Transform.from_vector([0.3, -0.2, 0.5], [0.4, 1.1, -0.3])
    here = moving(above, low, above)
    turned = Kinematics(
        here.kinematics.time,
        pose.inverse().apply(here.kinematics.position),
        here.kinematics.quaternion,
    )
    there = Sequence(Path(), "made", turned, here.cloud_times, here.cloud_files, None)
    one, other = describe_motion(dataset, here, Transform()), describe_motion(dataset, there, pose)
    np.testing.assert_allclose(one.contacts[0].place, other.contacts[0].place, atol=1e-9)
    assert one.contacts[0].kind == other.contacts[0].kind == "top"


def test_the_rest_after_release_is_counted_to_the_last_cloud(dataset: Dataset) -> None:
    above, low = (0.0, 0.0, TOP + RADIUS + 0.01), (0.0, 0.0, TOP + RADIUS - 0.005)
    motion = describe_motion(dataset, moving(above, low, above, above, above), Transform())
    np.testing.assert_allclose(motion.rest_after, 4.0 + 2.0 * 9.5 / 15, atol=0.15)
    assert motion.untouched_after == pytest.approx(10 * motion.rest_after, abs=1)


@pytest.mark.parametrize("rate", [2.0, 10.0, 25.0, 100.0, 1000.0])
def test_averages_are_exact_whatever_the_rate_of_the_stream(rate: float) -> None:
    time = np.arange(0.0, 4.0, 1 / rate)
    line = np.stack([3 * time, 1 - time], axis=-1)
    times = np.linspace(SMOOTHING, time[-1] - SMOOTHING, 57)
    expected = np.stack([3 * times, 1 - times], axis=-1)
    np.testing.assert_allclose(averaged(time, line, times), expected, atol=1e-9)
    corner = np.abs(time - 2.0)[:, None]
    at = averaged(time, corner, np.array([2.0]))[0, 0]
    assert at == pytest.approx(SMOOTHING / 2, abs=1e-9)


def test_a_stream_of_one_row_is_its_own_average() -> None:
    found = averaged(np.array([1.0]), np.array([[2.0, 3.0]]), np.array([0.0, 1.0, 5.0]))
    np.testing.assert_array_equal(found, [[2.0, 3.0]] * 3)
