"""Robot to phantom from traces over a free form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, SETUP
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import RegistrationError
from palpate.foundation.frames import Transform
from palpate.measurement.touch_correction import touch_correction
from palpate.registration.robot.trace_fit import fit_traces, refit_traces
from palpate.setup.setup import Shape, Tracing
from palpate.synthetic.bodies.shape_families import draw_shape
from palpate.synthetic.bodies.surface_traces import draw_traces

RADIUS = 5e-3


def _traced(family: str, seed: int) -> tuple[Shape, FloatArray, Transform]:
    """A body, traces over it in the robot's frame, and the robot's true pose."""
    shape, random = draw_shape(family, seed), np.random.default_rng([seed, 9])
    _, centres = draw_traces(shape, RADIUS, random)
    robot_from_phantom = Transform(
        Rotation.random(rng=random).as_matrix(), random.uniform(-0.25, 0.25, 3)
    )
    return shape, robot_from_phantom.apply(centres), robot_from_phantom.inverse()


def _away(found: Transform, true: Transform, shape: Shape) -> float:
    """Mean distance [m] of the surface's points between two poses of the robot."""
    places = shape.surface_points()
    return float(np.linalg.norm((found @ true.inverse()).apply(places) - places, axis=1).mean())


@pytest.mark.parametrize(("family", "seed"), [("liver", 5), ("kidney", 6), ("grooved", 7)])
def test_any_pose_of_the_robot_is_found_without_a_guess(family: str, seed: int) -> None:
    shape, points, true = _traced(family, seed)
    fit = fit_traces(points, shape, RADIUS)
    assert not fit.alternatives
    assert _away(fit.phantom_from_robot, true, shape) < 1.0e-3
    motion = fit.phantom_from_robot @ true.inverse()
    off = np.concatenate([motion.apply(fit.pivot[None])[0] - fit.pivot, motion.rotation_vector])
    assert off @ np.linalg.solve(fit.covariance, off) < 22.0  # 6 expected
    assert 40 < len(fit.traced) < len(points) and "are lifts" in fit.summary


def test_lifts_are_left_out_even_where_every_third_point_is_one() -> None:
    shape, points, true = _traced("liver", 8)
    random = np.random.default_rng(3)
    lifted = random.random(len(points)) < 0.25
    moved = true.apply(points)
    normals = shape.facing(moved)[1]
    moved[lifted] += random.uniform(2e-3, 8e-3, lifted.sum())[:, None] * normals[lifted]
    fit = fit_traces(true.inverse().apply(moved), shape, RADIUS, [true])
    assert _away(fit.phantom_from_robot, true, shape) < 0.8e-3


def test_poses_of_a_symmetric_body_are_alternatives_of_one_another() -> None:
    shape, points, true = _traced("dome", 4)
    fit = fit_traces(points, shape, RADIUS)
    poses = [one.phantom_from_robot for one in (fit, *fit.alternatives)]
    assert len(poses) > 1
    assert min(_away(pose, true, shape) for pose in poses) < 1.5e-3


def test_points_on_another_body_are_refused_in_words() -> None:
    shape, points, _ = _traced("kidney", 6)
    with pytest.raises(
        RegistrationError, match=r"traces.csv: \d+ of 72 points lie on the phantom's"
    ):
        fit_traces(points, shape.scaled(np.full(3, 0.4)), RADIUS)


def test_traces_lie_on_a_body_of_another_size_after_a_motion() -> None:
    shape, points, true = _traced("liver", 5)
    fit = fit_traces(points, shape, RADIUS, [true])
    larger = shape.scaled(np.array([1.03, 1.03, 1.03]))
    there = 1.03 * (fit.traced - shape.facing(fit.traced)[0][:, None] * shape.facing(fit.traced)[1])
    there = there + RADIUS * larger.facing(there)[1]
    shifted = Transform(np.eye(3), np.array([1e-3, -2e-3, 5e-4]))
    found = refit_traces(shifted.inverse().apply(there), larger, RADIUS)
    assert _away(found, shifted, larger) < 1e-4


def test_model_with_another_ball_moves_the_robot_as_its_traces_do() -> None:
    shape, points, true = _traced("grooved", 7)
    fit = fit_traces(points, shape, RADIUS, [true])
    centres = tuple((float(x), float(y), float(z)) for x, y, z in fit.traced)
    setup = replace(
        SETUP, geometry=shape, landmarks=(), tracing=Tracing(centres=centres, radius=RADIUS)
    )
    setup = replace(setup, touching=replace(setup.touching, misses=()))
    setup = replace(setup, tool=replace(setup.tool, radius=RADIUS))
    assert np.array_equal(touch_correction(setup, GRID).matrix, np.eye(4))
    larger = replace(setup, tool=replace(setup.tool, radius=RADIUS + 1e-3))
    found = touch_correction(larger, GRID)
    assert 1e-5 < np.linalg.norm(found.translation) < 2e-3
    # The motion is smooth: a tenth of the change gives a tenth of the motion.
    little = replace(setup, tool=replace(setup.tool, radius=RADIUS + 1e-4))
    np.testing.assert_allclose(
        10 * touch_correction(little, GRID).translation, found.translation, atol=1.5e-4
    )
