"""Forces of slow streams, of sensors that are never clear, and of stated deviations."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import Forces, Kinematics, Sequence
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.observation.force_only import observe_forces
from palpate.diagnosis.observation.force_record import (
    ForceComparison,
    ForceRecord,
    constant_discrepancy,
    force_scatter,
)
from palpate.foundation.arrays import FloatArray
from palpate.setup.setup import Box, Setup, Tool

SIZE = (0.06, 0.04, 0.03)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
STIFFNESS = 0.2 / 3e-3**1.5
STEPS = np.linspace(1e-5, 3e-3, 10)
CONSTANTS = np.array([[0.3, 0.0, -0.4], [-0.2, 0.1, 0.5], [0.0, 0.0, 0.1]])


def palpation(noise: float = 1e-3, constants: FloatArray = CONSTANTS) -> Sequence:
    """Depth steps of 0.5 s in three places, each with a constant of its own; no force between."""
    rows, forces, time = [], [], 0.0
    random = np.random.default_rng(1)
    for number, constant in enumerate(constants):
        x = 0.01 * number
        rows.append((time, x, 0.0, SIZE[2] + 0.015))
        time += 2.5
        for depth in STEPS:
            rows.append((time, x, 0.0, SIZE[2] + 5e-3 - depth))
            felt = constant + [0.0, 0.0, STIFFNESS * depth**1.5] + noise * random.normal(size=3)
            forces.append((time, *felt))
            time += 0.5
        time += 2.0
        rows.append((time, x, 0.0, SIZE[2] + 0.015))
        time += 1.0
    path, felt = np.array(rows), np.array(forces)
    turns = np.tile([0.0, 0.0, 0.0, 1.0], (len(path), 1))
    clock = Kinematics(path[:, 0], path[:, 1:], turns)
    return Sequence(Path("."), "felt", clock, np.empty(0), (), Forces(felt[:, 0], felt[:, 1:]))


def test_pushes_that_are_never_clear_have_a_constant_of_their_own() -> None:
    item = observe_forces(palpation(), SETUP, most=20)
    assert [group.push for group in item.groups] == [1, 1, 2, 2, 3, 3]
    measured, deviation = item.force_in_groups(SETUP.phantom_from_robot, 0.0) or (None, None)
    assert measured is not None and deviation is not None and item.forces is not None
    assert measured[1::2, 2] == pytest.approx([0.2] * 3, abs=0.02)
    assert np.abs(measured[:, :2]).max() < 5e-3
    assert item.forces.offset == pytest.approx(CRITERIA.force_error.constant_share * 0.2, rel=0.1)
    assert (deviation >= item.forces.offset).all()


def test_the_constants_of_pushes_are_columns_of_the_noise_and_not_scatter() -> None:
    forces = ForceComparison(
        np.zeros((4, 3)), np.full(4, 0.05), np.zeros((4, 3)), np.zeros((4, 3, 0)),
        np.array([1, 1, 2, 2]), offset=0.04,
    )  # fmt: skip

    class Touching:
        in_contact = True

    columns = constant_discrepancy(forces, [Touching()] * 4)  # type: ignore[list-item]
    assert columns.shape == (4, 3, 6)
    covariance = np.einsum("gik,hjk->gihj", columns, columns)
    assert covariance[0, 2, 1, 2] == pytest.approx(0.04**2)  # one constant within a push
    assert covariance[0, 2, 2, 2] == 0.0 and covariance[0, 2, 1, 0] == 0.0
    assert force_scatter(forces) == pytest.approx(np.full((4, 3), 0.05**2 - 0.04**2))
    assert constant_discrepancy(replace(forces, offset=0.0), []).shape == (4, 3, 0)


@pytest.mark.parametrize(("rate", "clear"), [(10.0, 1.6), (5.0, 2.0), (100.0, 0.5)])
def test_a_slow_stream_that_is_clear_for_some_seconds_has_a_record(
    rate: float, clear: float
) -> None:
    time = np.arange(0.0, 12.0, 1 / rate)
    force = np.random.default_rng(2).normal([0.1, 0.2, 0.3], 0.01, (len(time), 3))
    untouched = (time % 4.0) < clear
    record = ForceRecord.of(Forces(time, force), untouched)
    assert record is not None
    assert np.abs(record.force.mean(axis=0)).max() < 0.01
    assert ForceRecord.of(Forces(time, force), np.zeros(len(time), bool)) is None


def test_a_stated_deviation_is_part_of_every_force() -> None:
    time = np.arange(0.0, 10.0, 0.01)
    force = np.random.default_rng(3).normal(scale=0.01, size=(len(time), 3))
    plain = ForceRecord.of(Forces(time, force), time < 4.0)
    stated = ForceRecord.of(Forces(time, force, sigma=2.0), time < 4.0)
    assert plain is not None and stated is not None
    added = stated.bias_variance - plain.bias_variance
    assert added == pytest.approx(np.full(len(time), 4.0))
    own = palpation()
    assert own.forces is not None
    item = observe_forces(replace(own, forces=replace(own.forces, sigma=2.0)), SETUP, most=20)
    deviation = (item.force_in_groups(SETUP.phantom_from_robot, 0.0) or ((), np.zeros(1)))[1]
    assert (deviation >= 2.0).all()
