"""A whole search where two corners were taken for each other, so that the robot's registration
turns the block on its side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import CORNERS, GRID, POSE, SETUP, SIZE, observed, poke
from pushed_block import registration as stated_registration

from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.noise.rest_cloud import RestCloud
from palpate.diagnosis.inference.noise.rest_evidence import RestEvidence
from palpate.diagnosis.report.report import verdict_of
from palpate.diagnosis.search.forward_selection import search as find_causes
from palpate.effects import CATALOGUE, Linearisation
from palpate.effects.tool import LandmarkMismatch
from palpate.measurement.camera_model import camera_model_for
from palpate.measurement.segmentation import Cleaner
from palpate.measurement.touch_correction import touched_places
from palpate.mesh.box_mesh import GridSpec
from palpate.registration.registration import Registration
from palpate.registration.robot.landmark_repair import find_repairs
from palpate.registration.robot.robot_fit import fit_robot
from palpate.setup.box import Box
from palpate.setup.setup import Setup, Touching

BLOCK = Box(size=SIZE)

STATED = replace(SETUP, landmarks=CORNERS, touching=Touching(lift=5e-3))
LIFT, NOISE = np.array([0.0, 0.0, 5e-3]), 4e-4
STARTS = np.array([[0.0, 0.0, 0.06], [0.01, 0.0, 0.06]])
HIDDEN = LandmarkMismatch(pairing="swap-1-2", scale=0.87, inset=1e-3)


def _touched() -> tuple[Setup, Registration]:
    """What was stated of touches that were made otherwise, by a robot whose frame is the
    phantom's."""
    touches = (
        touched_places(HIDDEN.apply(STATED))
        + LIFT
        + 2e-4 * np.random.default_rng(5).standard_normal((4, 3))
    )
    expected = np.array(CORNERS) + LIFT
    found = fit_robot(touches, expected)
    misses = tuple((float(x), float(y), float(z)) for x, y, z in found.residuals)
    setup = replace(
        STATED,
        phantom_from_robot=found.phantom_from_robot,
        touching=Touching(misses=misses, lift=LIFT[2]),
    )
    (repair,) = find_repairs(touches, expected, BLOCK, STARTS)
    return setup, replace(
        stated_registration(), phantom_from_robot=found.phantom_from_robot, repair=repair
    )


def _at_rest(setup: Setup) -> RestEvidence:
    random = np.random.default_rng(0)
    low, high = (
        np.array([-SIZE[0] / 2, -SIZE[1] / 2, 0.0]),
        np.array([SIZE[0] / 2, SIZE[1] / 2, SIZE[2]]),
    )
    places = [random.uniform(-0.09, 0.09, (8000, 3)) * [1.0, 1.0, 0.0]]
    places[0] = places[0][(np.abs(places[0][:, :2]) > high[:2] + 8e-3).any(axis=1)]
    for axis, end in ((2, high), (0, low), (1, low)):
        side = random.uniform(low, high, (6000, 3))
        side[:, axis] = end[axis]
        places.append(side)
    cloud = camera_model_for(STATED).read(np.concatenate(places))
    cloud += (
        NOISE
        * random.standard_normal((len(cloud), 1))
        * cloud
        / np.linalg.norm(cloud, axis=1)[:, None]
    )
    cleaner = Cleaner(geometry=BLOCK, phantom_from_camera=POSE, tool_radius=5e-3, noise=NOISE)
    return RestEvidence(RestCloud.of(cloud, cleaner, setup, GRID))


@pytest.mark.slow
def test_swapped_corners_are_named_with_the_size_of_the_touched_polygon_and_nothing_else() -> None:
    # Effects that are screened by replays of a finite size do not matter here.
    catalogue = [
        kind for kind in CATALOGUE if kind.linearisation is not Linearisation.FINITE_DIFFERENCE
    ]
    setup, registration = _touched()
    assert (
        np.arccos(setup.phantom_from_robot.rotation[2, 2]) > 0.5
    )  # the tool would come from the side, or from below
    data = []
    for seed, (x, y) in enumerate(((4e-3, -2e-3), (-1.2e-2, 5e-3), (1.5e-2, 4e-3))):
        centres = np.array([poke(-6e-3, x, y), poke(2e-3, x, y), poke(4e-3, x, y)])
        data.append(
            replace(observed(STATED, centres, noise=3e-4, seed=10 * seed), name=f"poke-0{seed + 1}")
        )
    with Workers(data, 1) as workers:
        fine = GridSpec(nodes=(11, 9, 7), spacing=1.7e-3)
        evaluator = evaluator_of(
            setup,
            registration,
            workers,
            [item.name for item in data],
            _at_rest(setup),
            GRID,
            fine,
            catalogue=catalogue,
        )
        found = find_causes(evaluator, seed=0)
    assert verdict_of(found) == "found" and found.best is not None and found.best.gain > 1000
    (effect,) = found.best.model.effects
    assert isinstance(effect, LandmarkMismatch) and effect.pairing == "swap-1-2"
    assert effect.scale == pytest.approx(0.87, abs=0.03) and effect.inset == pytest.approx(
        1e-3, abs=6e-4
    )
    assert evaluator.misfit(found.best.model) < 1.2 < found.misfit
    assert found.known and not found.remaining.significant
