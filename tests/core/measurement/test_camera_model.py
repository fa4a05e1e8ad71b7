"""The camera model with a misread depth and a block of another size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import POSE, SETUP, SIZE, TOP

from palpate.effects import Effect
from palpate.effects.geometry import GeometryScale
from palpate.effects.sensor import CameraRegistration, DepthBias
from palpate.foundation.arrays import FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import CameraModel, camera_model_for
from palpate.registration.camera.block_fit import fit_camera
from palpate.setup.setup import Setup

SMALLER = GeometryScale(scale_x=1.04, scale_y=0.97, scale_z=1.03)
STRETCHED = DepthBias(offset=0.0, scale=1.02)
FAR = DepthBias(offset=4e-3, scale=1.0)
LOW, HIGH = np.array([-SIZE[0] / 2, -SIZE[1] / 2, 0.0]), np.array([SIZE[0] / 2, SIZE[1] / 2, TOP])
SIDES = {"top": (2, TOP), "-x": (0, LOW[0]), "-y": (1, LOW[1])}
"""Those that the camera sees: axis and coordinate of each [m]."""


def _side(name: str, count: int = 3000) -> FloatArray:
    axis, end = SIDES[name]
    places = np.random.default_rng(axis).uniform(LOW, HIGH, (count, 3))
    places[:, axis] = end
    return places


def _as_stated(setup: Setup, name: str) -> FloatArray:
    """Distance (m,) [m] of the true side's points outside of the stated side."""
    axis, end = SIDES[name]
    placed = POSE.apply(camera_model_for(setup, reference=True).read(_side(name) * setup.scale))
    return (placed[:, axis] - end) * (1.0 if name == "top" else -1.0)


def test_place_is_the_inverse_of_read():
    sight, places = CameraModel(POSE, 3e-3, 0.96), _side("top")
    assert np.allclose(sight.place(sight.read(places)), places, atol=1e-12)
    assert not np.allclose(CameraModel(POSE).read(places), sight.read(places), atol=1e-3)


def test_a_depth_is_read_as_scale_times_it_and_offset_along_the_ray():
    true = np.array([[0.02, -0.03, 0.4]])
    read = CameraModel(POSE, 5e-3, 1.1).read(POSE.apply(true))
    assert read[0, 2] == pytest.approx(1.1 * 0.4 + 5e-3)
    assert np.allclose(read[0] / read[0, 2], true[0] / true[0, 2])


def test_camera_without_errors_sees_as_stated():
    assert np.array_equal(camera_model_for(SETUP).pose.matrix, POSE.matrix)
    moved = CameraRegistration(tx=1e-3, ty=0.0, tz=0.0, rx=0.0, ry=0.0, rz=0.02).apply(SETUP)
    assert np.array_equal(camera_model_for(moved, reference=True).pose.matrix, POSE.matrix)
    assert np.allclose(
        camera_model_for(moved).pose.matrix, (moved.sensor.camera_shift @ POSE).matrix
    )


def test_registered_sides_lie_on_the_stated_ones_and_the_top_shows_the_height():
    setup = SMALLER.apply(SETUP)
    moved = camera_model_for(setup).pose @ POSE.inverse()
    assert np.allclose(moved.translation, [-0.02 * SIZE[0], 0.015 * SIZE[1], 0.0], atol=1e-9)
    assert np.allclose(moved.rotation, np.eye(3), atol=1e-9)
    for side, off in (("-x", 0.0), ("-y", 0.0), ("top", 0.03 * TOP)):
        assert np.allclose(_as_stated(setup, side), off, atol=1e-9)


def test_scaled_depth_looks_like_a_block_of_another_size():
    setup = STRETCHED.apply(SETUP)
    for side, off in (("-x", 0.0), ("-y", 0.0), ("top", 0.02 * TOP)):
        assert np.allclose(_as_stated(setup, side), off, atol=1e-8)


def test_offset_is_a_motion_of_the_camera_but_for_its_share_of_the_distance():
    """Rays spread, so that what reads 4 mm farther looks 1 % larger at 0.4 m: a scale of that size,
    and little else.
    """
    setup, distance = FAR.apply(SETUP), float(np.linalg.norm(POSE.translation))
    assert np.mean(_as_stated(setup, "top")) == pytest.approx(4e-3 / distance * TOP, rel=0.5)
    for side in SIDES:
        assert np.std(_as_stated(setup, side)) < 1.2e-4


def _rest_cloud(setup: Setup, true: CameraModel) -> FloatArray:
    """Raw cloud (n, 3) [m] of the true block on its table, without noise."""
    table = np.random.default_rng(9).uniform(-0.09, 0.09, (9000, 3)) * [1.0, 1.0, 0.0]
    half = np.array(setup.geometry.size[:2]) / 2
    table = table[(np.abs(table[:, :2]) > half + 6e-3).any(axis=1)]
    return true.read(np.concatenate([*(_side(name) * setup.scale for name in SIDES), table]))


@pytest.mark.parametrize(
    ("effect", "tolerance"), [(SMALLER, 1e-4), (STRETCHED, 1e-4)], ids=["size", "stretched"]
)
def test_registration_error_is_inverted(effect: Effect, tolerance: float):
    """Of an offset the registration itself takes a part for a smooth error of the camera; that is a
    motion of the camera again.
    """
    setup = effect.apply(SETUP)
    cloud = _rest_cloud(
        setup, CameraModel(POSE, setup.sensor.depth_offset, setup.sensor.depth_scale)
    )
    stated = fit_camera(cloud, SIZE, 0.002, POSE).phantom_from_camera
    found = camera_model_for(replace(setup, phantom_from_camera=stated)).pose
    block = np.concatenate([_side(name) for name in SIDES])

    def off(pose: Transform) -> float:
        return float(np.linalg.norm((pose @ POSE.inverse()).apply(block) - block, axis=1).max())

    assert off(found) < tolerance
    assert off(stated) > 3 * tolerance
