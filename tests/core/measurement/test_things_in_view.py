"""A rigid holder beside a phantom: its points are left out, and its place helps to register."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from palpate.foundation.arrays import BoolArray, FloatArray
from palpate.foundation.frames import Transform
from palpate.measurement.segmentation import Cleaner
from palpate.registration.shape.seen_body import SeenBody
from palpate.registration.shape.shape_fit import fit_shape_camera
from palpate.setup.setup import Shape
from palpate.synthetic.bodies.shape_families import draw_shape

NOISE = 8e-4


@dataclass(frozen=True)
class _View:
    """A cloud (n, 3) [m], camera frame, with the true pose and which points are the holder's."""

    shape: Shape
    pose: Transform
    cloud: FloatArray
    holder: BoolArray
    body: BoolArray


@pytest.fixture(scope="module")
def view() -> _View:
    bare = draw_shape("liver", 3)
    wall = trimesh.creation.box((0.004, 0.07, 0.03))
    wall.apply_translation((bare.high[0] + 0.004, 0.0, 0.015))
    solid = np.array(wall.vertices), np.array(wall.faces, dtype=np.int64)
    shape = replace(bare, in_view=(solid,))
    camera = np.array([0.26, 0.08, 0.26])
    axis = -camera / np.linalg.norm(camera)
    side = np.cross(axis, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    pose = Transform(np.stack([side, np.cross(axis, side), axis], axis=1), camera)
    u, v = (grid.ravel() for grid in np.meshgrid(*2 * [np.linspace(-0.3, 0.3, 160)]))
    ways = pose.rotate(np.stack([u, v, np.ones_like(u)], axis=1))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    hits = SeenBody(shape).cast(camera, ways)
    floor = np.where(ways[:, 2] < 0, -camera[2] / ways[:, 2], np.inf)
    depth = np.minimum(np.minimum(hits.distance, hits.blocked), floor)
    depth = depth + np.random.default_rng(0).normal(size=len(depth)) * NOISE
    points = camera + depth[:, None] * ways
    return _View(shape, pose, pose.inverse().apply(points), hits.hidden, hits.met)


def test_points_whose_rays_end_on_the_holder_are_left_out(view: _View) -> None:
    assert view.holder.sum() > 300
    cleaner = Cleaner(
        geometry=view.shape, phantom_from_camera=view.pose, tool_radius=5e-3, noise=NOISE
    )
    found = cleaner.clean(view.cloud)
    assert found.counts["holder"] == view.holder.sum()
    assert not view.holder[found.indices].any()
    assert view.body[found.indices].mean() > 0.97
    assert np.isin(np.flatnonzero(view.body), found.indices).mean() > 0.85
    bare = replace(cleaner, geometry=replace(view.shape, in_view=()))
    assert view.holder[bare.clean(view.cloud).indices].sum() > 50


def test_body_behind_a_holder_is_registered_as_if_it_were_not_there(view: _View) -> None:
    fit = fit_shape_camera(view.cloud, view.shape, NOISE)
    places = view.shape.surface_points()
    there = fit.phantom_from_camera @ view.pose.inverse()
    assert np.linalg.norm(there.apply(places) - places, axis=1).mean() < 0.5e-3
    assert Rotation.from_matrix(there.rotation).magnitude() < np.radians(0.7)


def test_rays_that_end_on_a_holder_meet_no_body(view: _View) -> None:
    hits = SeenBody(view.shape).cast(view.pose.translation, np.array([[-1.0, 0.0, 0.0]]))
    assert not hits.met[0] and not hits.hidden[0]
    scaled = view.shape.scaled(np.array([1.02, 1.0, 1.0]))
    assert scaled.in_view is view.shape.in_view
