"""Registration of datasets whose phantom is no block."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shapes import write_felt_shape
from small_dataset import ply_bytes

from benchmarks.shape_registration import Seen, look
from palpate.dataset import Dataset, open_dataset
from palpate.effects.geometry import GeometryScale
from palpate.foundation.frames import Transform
from palpate.measurement.camera_model import camera_model_for
from palpate.registration.point_pairs import register_pairs
from palpate.registration.registration import register
from palpate.registration.rest_fit import refine_rest_cloud
from palpate.registration.shape.seen_body import SeenBody
from palpate.setup.free_form.shape import Shape
from palpate.setup.setup import Sensor, Setup, Tool
from palpate.synthetic.bodies.shape_families import draw_shape

PLACE = np.array([0.024, 0.008])
"""Place of the push beside the middle [m]."""


def _write(root: Path, shape: Shape, seen: Seen) -> Dataset:
    """A dataset of this view: one push beside the middle, whose clouds show the ball too."""
    write_felt_shape(root, shape.vertices, shape.triangles)
    text = (root / "dataset.toml").read_text()
    (root / "dataset.toml").write_text(
        text.replace(
            "[splits]", f'[camera]\nname = "made up"\ndepth_sigma = {seen.noise}\n[splits]'
        )
    )
    (root / "rest.ply").write_bytes(ply_bytes(seen.cloud))
    folder = root / "sequences" / "p1"
    time = np.arange(0, 6, 0.02)
    height = shape.height + 0.015 - 0.014 * np.clip(np.minimum(time - 1, 5 - time), 0, 1)
    rows = [
        f"{t:.2f},{PLACE[0]},{PLACE[1]},{z:.6f},0,0,0,1" for t, z in zip(time, height, strict=True)
    ]
    (folder / "kinematics.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]) + "\n")
    (folder / "clouds").mkdir()
    stamps = np.array([0.5, 1.5, 2.5, 3.5])
    for number, instant in enumerate(stamps):
        centre = np.array([*PLACE, float(np.interp(instant, time, height))])
        to_camera = seen.pose.translation - centre
        ways = np.random.default_rng(number).normal(size=(600, 3))
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        ball = centre + 5e-3 * ways[ways @ to_camera > 0]
        whole = np.concatenate([seen.cloud, seen.pose.inverse().apply(ball)])
        (folder / "clouds" / f"{number:06d}.ply").write_bytes(ply_bytes(whole))
    lines = [f"{t:.2f},clouds/{n:06d}.ply" for n, t in enumerate(stamps)]
    (folder / "clouds.csv").write_text("\n".join(["t,file", *lines]) + "\n")
    return open_dataset(root)


def _turn(found: np.ndarray, seen: Seen) -> float:
    """Angle [degrees] between a rotation (3, 3) and the true one."""
    cosine = 0.5 * (np.trace(found @ seen.pose.rotation.T) - 1)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def test_camera_of_a_free_form_is_registered_without_a_guess(tmp_path: Path) -> None:
    shape = draw_shape("liver", 0)
    seen = look(SeenBody(shape), 4, table=True)
    found = register(_write(tmp_path, shape, seen))
    assert found.camera is not None and found.camera.face_counts["surface"] > 500
    assert np.linalg.norm(found.phantom_from_camera.translation - seen.pose.translation) < 2e-3
    assert _turn(found.phantom_from_camera.rotation, seen) < 0.5


@pytest.mark.parametrize("seed", [2, 5])
def test_tool_decides_between_poses_that_look_alike(tmp_path: Path, seed: int) -> None:
    shape = draw_shape("dome", 0)
    seen = look(SeenBody(shape), seed, table=True)
    found = register(_write(tmp_path, shape, seen))
    assert _turn(found.phantom_from_camera.rotation, seen) < 3.0
    assert not any("looks alike" in text for text in found.warnings)


def test_clicks_are_refined_on_a_free_form(tmp_path: Path) -> None:
    shape = draw_shape("kidney", 0)
    seen = look(SeenBody(shape), 7, table=True)
    places = shape.surface_points()[::400]
    clicked = seen.pose.inverse().apply(places + 1.5e-3)
    pairs = register_pairs(seen.cloud, shape, clicked, places)
    assert pairs.after < pairs.before and pairs.points > 1000
    apart = pairs.camera.phantom_from_camera.translation - seen.pose.translation
    assert np.linalg.norm(apart) < 2e-3


def test_registration_error_of_another_size_is_inverted() -> None:
    stated = draw_shape("liver", 0)
    setup = Setup(geometry=stated, tool=Tool(radius=5e-3))
    longer = GeometryScale(scale_x=1.04, scale_y=0.97, scale_z=1.03).apply(setup)
    seen = look(SeenBody(longer.geometry), 4, table=True)
    fit = refine_rest_cloud(seen.cloud, stated, seen.pose, 1e-3)
    sensor = Sensor(depth_sigma=1e-3, view=fit.view)
    registered = replace(longer, sensor=sensor, phantom_from_camera=fit.phantom_from_camera)
    places = stated.surface_points()

    def off(pose: Transform) -> float:
        apart = (pose @ seen.pose.inverse()).apply(places) - places
        return float(np.linalg.norm(apart, axis=1).mean())

    assert off(fit.phantom_from_camera) > 1.5e-3
    assert off(camera_model_for(registered, reference=True).pose) < 0.4e-3
