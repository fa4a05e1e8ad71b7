"""The virtual depth camera's noise, bias, quantum and occlusion."""

from __future__ import annotations

import numpy as np
import pytest

from palpate.synthetic.bench.depth_camera import QUANTUM, CameraScene, DepthCamera, place_camera
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.scenario.scenario import Scenario

SEEN = np.array([1.0, -1.0])
DOWN = np.array([0.0, 0.0, -1.0])


@pytest.fixture(scope="module")
def scene() -> CameraScene:
    rest, settled, faces = rest_surface(Scenario())
    return CameraScene((rest + settled, faces), None, DOWN, 0.005)


@pytest.fixture(scope="module")
def camera(scene: CameraScene) -> DepthCamera:
    return place_camera(np.random.default_rng(5), Scenario().size, scene.block, SEEN, 2600, 0.7e-3)


def test_cloud_has_the_wanted_number_of_points_on_the_block(
    camera: DepthCamera, scene: CameraScene
) -> None:
    cloud = camera.phantom_from_camera.apply(camera.cloud(scene, np.random.default_rng(0)))
    x, y, z = Scenario().size
    inside = (
        (np.abs(cloud[:, 0]) < x / 2 + 2e-3)
        & (np.abs(cloud[:, 1]) < y / 2 + 2e-3)
        & (cloud[:, 2] > 3e-3)
        & (cloud[:, 2] < z + 3e-3)
    )
    assert 2200 < inside.sum() < 3000
    assert len(cloud) - inside.sum() > 600


def test_camera_sees_the_top_and_the_two_sides_it_should(
    camera: DepthCamera, scene: CameraScene
) -> None:
    depth, what = camera.depth(scene)
    seen = camera.phantom_from_camera.apply(camera.rays[what == 0] * depth[what == 0, None])
    x, y, z = Scenario().size
    assert np.sum(np.abs(seen[:, 2] - z) < 1e-5) > 500
    assert np.sum(np.abs(seen[:, 0] - x / 2) < 1e-5) > 200
    assert np.sum(np.abs(seen[:, 1] + y / 2) < 1e-5) > 200


def test_depths_are_multiples_of_the_quantum(camera: DepthCamera, scene: CameraScene) -> None:
    steps = camera.cloud(scene, np.random.default_rng(0))[:, 2] / QUANTUM
    assert np.allclose(steps, np.round(steps), atol=1e-6)


def test_noise_grows_with_the_square_of_the_distance(
    camera: DepthCamera, scene: CameraScene
) -> None:
    depth, _ = camera.depth(scene)
    spreads = {}
    for near, far in ((0.0, 0.36), (0.36, 9.0)):
        errors, scales = [], []
        for seed in range(12):
            cloud = camera.cloud(scene, np.random.default_rng(seed))
            index = np.argmin(
                np.abs(camera.rays[:, None, :2] - (cloud[:40, :2] / cloud[:40, 2:])[None]).sum(
                    axis=2
                ),
                axis=0,
            )
            error = cloud[:40, 2] - depth[index] - camera.bias[index]
            errors.append(error)
            scales.append((depth[index] / 0.35) ** 2)
        error, scale = np.concatenate(errors), np.concatenate(scales)
        chosen = (
            (np.sqrt(scale) * 0.35 >= near) & (np.sqrt(scale) * 0.35 < far) & (np.abs(error) < 4e-3)
        )
        if chosen.sum() > 50:
            spreads[near] = np.std(error[chosen] / scale[chosen])
    assert spreads
    for spread in spreads.values():
        assert spread == pytest.approx(camera.sigma, rel=0.2)


def test_bias_is_smooth_and_a_third_of_a_millimetre(camera: DepthCamera) -> None:
    image = camera.bias.reshape(camera.shape)
    assert np.sqrt(np.mean(image**2)) == pytest.approx(0.3e-3, rel=1e-6)
    assert np.abs(np.diff(image, axis=1)).max() < 0.05e-3


def test_points_behind_tool_and_shaft_are_not_seen(camera: DepthCamera, scene: CameraScene) -> None:
    centre = np.array([0.005, -0.002, Scenario().size[2] + 0.012])
    depth, what = camera.depth(scene)
    poked = CameraScene(scene.block, centre, DOWN, 0.005)
    nearer, by = camera.depth(poked)
    hidden = (what == 0) & (by >= 2)
    assert hidden.sum() > 20
    assert np.all(nearer[hidden] < depth[hidden])
    towards = camera.phantom_from_camera.apply(camera.rays[by >= 2] * nearer[by >= 2, None])
    beside = towards - centre
    assert np.all(beside[:, 2] > -0.0051)
    assert np.all(np.linalg.norm(beside[:, :2], axis=1) < 0.0051)
