"""Instants and places of the pushes in sequences with forces and no clouds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import Forces, Kinematics, Sequence
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.inference.applicable_effects import applicable_effects
from palpate.diagnosis.observation.force_only import deepest_rows, observe_forces, pushed_places
from palpate.diagnosis.search.inclusion_grid import inclusions_under
from palpate.effects import DIAGNOSED
from palpate.effects.elastic_material import StiffInclusion, YoungModulus
from palpate.effects.heterogeneity import SurfaceLayer
from palpate.effects.sensor import CameraRegistration, TimeOffset
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DiagnosisError
from palpate.setup.setup import Box, Setup, Shape, Tool
from palpate.synthetic.bodies.organ_shape import organ_surface

SIZE = (0.06, 0.04, 0.03)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
RATE = 100.0


def _sequence(places: list[tuple[float, float]], depths: list[float]) -> Sequence:
    """Two seconds clear, then pushes straight down: half a second in, one second held, half a
    second out, one clear.
    """
    way, clear = [np.tile([0.0, 0.0, 0.06], (200, 1))], [np.ones(200)]
    for (x, y), depth in zip(places, depths, strict=True):
        arc = np.concatenate(
            [
                np.linspace(-0.01, depth, 50),
                np.full(100, depth),
                np.linspace(depth, -0.01, 50),
                np.full(100, -0.01),
            ]
        )
        way.append(np.column_stack([np.full(300, x), np.full(300, y), SIZE[2] + 5e-3 - arc]))
        clear.append((arc <= 0).astype(float))
    position, free = np.concatenate(way), np.concatenate(clear)
    time = np.arange(len(position)) / RATE
    force = np.where(free[:, None] > 0, 0.0, [[0.0, 0.0, 0.2]]) + np.array([0.03, 0.0, -0.01])
    force = force + 1e-3 * np.random.default_rng(0).normal(size=force.shape)
    stream = Kinematics(time, position, np.tile([0.0, 0.0, 0.0, 1.0], (len(time), 1)))
    return Sequence(Path("."), "felt", stream, np.empty(0), (), Forces(time, force))


def test_each_push_has_a_group_on_the_way_in_and_one_of_its_hold() -> None:
    item = observe_forces(_sequence([(0.0, 0.0), (0.01, 0.0)], [4e-3, 3e-3]), SETUP, most=20)
    assert item.force_only and [group.push for group in item.groups] == [1, 1, 2, 2]
    depth = SIZE[2] + 5e-3 - item.centres(SETUP)[:, 2]
    assert depth == pytest.approx([0.55 * 4e-3, 4e-3, 0.55 * 3e-3, 3e-3], abs=4e-4)
    assert deepest_rows(item) == [1, 3]
    held = item.times[list(item.groups[1].frames)]
    assert len(held) == 8 and np.ptp(held) > 0.6
    forces = item.force_in_groups(SETUP.phantom_from_robot, 0.0)
    assert forces is not None and forces[0][[1, 3], 2] == pytest.approx(0.2, abs=2e-3)


def test_pushes_are_thinned_evenly() -> None:
    item = observe_forces(
        _sequence([(0.005 * n, 0.0) for n in range(5)], [4e-3] * 5), SETUP, most=6
    )
    assert len(item.groups) == 6
    assert pushed_places([item], SETUP)[0][:, 0] == pytest.approx([0.0, 0.01, 0.02], abs=1e-9)


def test_places_lie_on_the_surface_below_the_tool() -> None:
    places, normals = pushed_places(
        [observe_forces(_sequence([(0.01, -0.01)], [4e-3]), SETUP, 20)], SETUP
    )
    assert places[0] == pytest.approx([0.01, -0.01, SIZE[2]], abs=1e-9) and normals[0].tolist() == [
        0,
        0,
        1,
    ]


def test_sequence_without_pushes_is_refused_with_its_largest_depth() -> None:
    with pytest.raises(
        DiagnosisError, match=r"nothing is pressed by 0.5 mm or more \(at most 0.20 mm"
    ):
        observe_forces(_sequence([(0.0, 0.0)], [2e-4]), SETUP, 20)


def test_sensor_that_is_never_clear_is_refused() -> None:
    sequence = _sequence([(0.0, 0.0)], [4e-3])
    held = np.tile([0.0, 0.0, SIZE[2] + 3e-3], (len(sequence.kinematics.time), 1))
    stream = Kinematics(sequence.kinematics.time, held, sequence.kinematics.quaternion)
    with pytest.raises(DiagnosisError, match="hardly ever clear of the phantom"):
        observe_forces(
            Sequence(Path("."), "felt", stream, np.empty(0), (), sequence.forces), SETUP, 20
        )


def test_lumps_are_looked_for_below_the_pushes_and_within_the_body() -> None:
    places = np.array([[0.0, 0.0, 0.03], [0.002, 0.0, 0.03], [0.02, 0.0, 0.03]])
    found = inclusions_under(places, np.tile([0.0, 0.0, 1.0], (3, 1)), SETUP.geometry)
    assert [(lump.x, round(0.03 - lump.z, 6)) for lump in found] == [
        (x, depth) for x in (0.0, 0.02) for depth in CRITERIA.inclusion_grid.depths
    ]
    flat = inclusions_under(
        np.array([[0.0, 0.0, 0.01]]), np.array([[0.0, 0.0, 1.0]]), Box(size=(0.06, 0.04, 0.01))
    )
    assert len(flat) == 1


def test_forces_alone_weigh_what_they_can_tell_and_clouds_all() -> None:
    forces = applicable_effects(SETUP, clouds=False, forces=True)
    assert {StiffInclusion, YoungModulus, SurfaceLayer} <= set(forces) and not {
        CameraRegistration,
        TimeOffset,
    } & set(forces)
    organ = Setup(geometry=Shape(*organ_surface(4e-3)), tool=SETUP.tool)
    on_an_organ = applicable_effects(organ, clouds=False, forces=True)
    assert set(on_an_organ) == set(forces) and len(on_an_organ) == 12
    assert applicable_effects(SETUP, clouds=True, forces=False) == tuple(
        kind for kind in DIAGNOSED if not kind.needs_shape
    )
    shaped = applicable_effects(organ, clouds=True, forces=False)
    assert set(DIAGNOSED) - set(shaped) == {kind for kind in DIAGNOSED if kind.needs_box}


def _bumps() -> FloatArray:
    return np.array([[0.0, 0.0, 0.04]])


def test_signed_distance_of_an_organ_is_negative_within() -> None:
    distance, normal = Shape(*organ_surface()).facing(
        np.concatenate([_bumps(), [[0.0, 0.0, 0.02]]])
    )
    assert distance[0] > 0 > distance[1] and (normal[:, 2] > 0.9).all()
