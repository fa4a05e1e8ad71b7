from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from palpate.dataset import open_dataset
from palpate.measurement.segmentation import CleanCloud, Cleaner, cleaner_for
from palpate.measurement.tool_pose import ToolPose, ToolShaft, find_shaft, tool_poses
from palpate.registration.faces import box_distance
from palpate.registration.pose import small_motion
from palpate.registration.registration import register
from palpate.setup.box import Box

SIZE = (0.0687, 0.0393, 0.0358)
PHANTOM = Box(size=SIZE)
RADIUS = 4e-3
"""Of the shaft of a scene [m]."""
TABLE, BLOCK, SPHERE, SHAFT, STRAY = range(5)
UP = np.array([0.0, 0.0, 1.0])
TILTED = np.array([0.3, 0.2, 0.93]) / np.linalg.norm([0.3, 0.2, 0.93])


def cleaned(view, tool=None, noise: float = 7e-4) -> CleanCloud:
    return Cleaner(
        geometry=PHANTOM, phantom_from_camera=view.pose, tool_radius=0.005, noise=noise
    ).clean(view.cloud, tool)


def kept(found: CleanCloud, label: np.ndarray, what: int) -> float:
    """Share of the points of one label that was kept."""
    rows = np.flatnonzero(label == what)
    return float(np.isin(rows, found.indices).mean())


def test_rest_cloud_keeps_the_block_and_loses_the_table(scene):
    view = scene().look(seed=1)
    found = cleaned(view)
    assert kept(found, view.label, BLOCK) > 0.93
    assert kept(found, view.label, TABLE) < 0.02
    assert kept(found, view.label, STRAY) < 0.25
    assert sum(found.counts.values()) == len(view.cloud)
    assert np.abs(found.table_points[:, 2]).max() < 2.5e-3


@pytest.mark.parametrize("shaft", [UP, TILTED])
@pytest.mark.parametrize("depth", [0.0, 0.004, 0.008])
def test_tool_points_go_and_the_dent_around_them_stays(scene, shaft, depth):
    centre = np.array([0.008, -0.004, SIZE[2] + 0.005 - depth])
    view = scene(tool=tuple(centre), shaft=tuple(shaft), pixels=150).look(seed=2)
    found = cleaned(view, ToolPose(centre, ToolShaft(shaft, RADIUS)))
    assert kept(found, view.label, SPHERE) < 0.1
    assert kept(found, view.label, SHAFT) < 0.01
    near = np.linalg.norm(view.pose.apply(view.cloud)[:, :2] - centre[:2], axis=1) < 0.012
    around = np.flatnonzero((view.label == BLOCK) & near)
    assert np.isin(around, found.indices).mean() > 0.85
    assert kept(found, view.label, BLOCK) > 0.94


def test_points_of_a_side_above_the_lowest_height_have_no_bias(scene):
    """Below it only points are left that noise has brought out of the side."""
    random, noise = np.random.default_rng(8), 5e-4
    pose = scene().look(seed=1).pose
    camera = pose.translation
    side = np.array([0, 1])[int(abs(camera[1]) > abs(camera[0]))]
    foot = random.uniform([-0.015] * 3, [0.015] * 3, (40_000, 3))
    foot[:, side], foot[:, 2] = (
        np.sign(camera[side]) * SIZE[side] / 2,
        random.uniform(0.0, 0.012, 40_000),
    )
    away = (foot - camera) / np.linalg.norm(foot - camera, axis=1)[:, None]
    off = noise * random.standard_normal(len(foot))
    cleaner = Cleaner(geometry=PHANTOM, phantom_from_camera=pose, tool_radius=0.005, noise=noise)
    found = cleaner.clean(pose.inverse().apply(foot + off[:, None] * away)).indices
    above = foot[found, 2] > cleaner.lowest
    assert abs(off[found][above].mean()) < 4 * noise / np.sqrt(above.sum())
    assert off[found][~above].mean() < -0.1 * noise
    assert above[foot[found, 2] > 2.5e-3].all()


def test_points_are_handed_over_in_the_phantom_frame_with_their_rows(scene):
    view = scene().look(seed=3)
    found = cleaned(view)
    np.testing.assert_allclose(found.points, view.pose.apply(view.cloud[found.indices]))


def test_a_tool_two_millimetres_beside_its_stated_place_is_still_taken_out(scene):
    centre = np.array([0.005, 0.003, SIZE[2] + 0.001])
    view = scene(tool=tuple(centre), shaft=tuple(TILTED), pixels=150).look(seed=4)
    stated = ToolPose(centre + np.array([0.002, -0.001, 0.0]), ToolShaft(TILTED, RADIUS))
    found = cleaned(view, stated)
    assert kept(found, view.label, SPHERE) < 0.15
    assert kept(found, view.label, SHAFT) < 0.01
    assert kept(found, view.label, BLOCK) > 0.94


def test_a_camera_bumped_after_its_registration_still_separates_table_and_block(scene):
    view = scene().look(seed=6)
    bumped = (
        small_motion(
            np.array([0.002, -0.002, 0.0025, 0.03, -0.02, 0.02]), np.array([0.0, 0.0, SIZE[2]])
        )
        @ view.pose
    )
    found = cleaned(replace(view, pose=bumped))
    assert kept(found, view.label, BLOCK) > 0.9
    assert kept(found, view.label, TABLE) < 0.02


def test_an_empty_cloud_gives_an_empty_one(scene):
    cleaner = Cleaner(
        geometry=PHANTOM,
        phantom_from_camera=scene().look(seed=7).pose,
        tool_radius=0.005,
        noise=7e-4,
    )
    found = cleaner.clean(np.empty((0, 3)), ToolPose(np.zeros(3), ToolShaft(UP, RADIUS)))
    assert found.points.shape == (0, 3) and sum(found.counts.values()) == 0


def test_kept_points_beside_the_shaft_have_no_bias(scene):
    centre, noise = np.array([0.0, 0.0, SIZE[2] + 0.001]), 3e-3
    look = scene(tool=tuple(centre), pixels=300, bias=0.0, strays=0)
    errors = []
    for seed in range(4):
        exact, view = replace(look, noise=0.0).look(seed), replace(look, noise=noise).look(seed)
        found = cleaned(view, ToolPose(centre, ToolShaft(UP, RADIUS)), noise).indices
        places = exact.pose.apply(exact.cloud)
        beside = np.linalg.norm(places[:, :2] - centre[:2], axis=1)
        near = (beside > 6e-3) & (beside < 12e-3) & (view.label == BLOCK)
        rows = found[near[found]]
        errors.append(np.linalg.norm(view.cloud[rows], axis=1))
        errors[-1] -= np.linalg.norm(exact.cloud[rows], axis=1)
    error = np.concatenate(errors)
    assert len(error) > 1000
    assert abs(error.mean()) < 0.05e-3 + 2 * error.std() / np.sqrt(len(error))


def test_tool_of_another_size_than_stated_goes_if_its_size_is_allowed(scene):
    centre = np.array([0.008, -0.004, SIZE[2] + 0.003])
    view = scene(tool=tuple(centre), pixels=150).look(seed=2)
    stated = Cleaner(geometry=PHANTOM, phantom_from_camera=view.pose, tool_radius=2e-3, noise=4e-4)
    tool = ToolPose(centre, ToolShaft(UP, RADIUS))
    assert kept(stated.clean(view.cloud, tool), view.label, SPHERE) > 0.1
    found = stated.allowing(5e-3).clean(view.cloud, tool)
    assert kept(found, view.label, SPHERE) < 0.05
    assert kept(found, view.label, BLOCK) > 0.93


def test_measured_datasets_keep_the_block_and_little_else(measured_datasets):
    for path in measured_datasets[:3]:
        dataset = open_dataset(path)
        registration = register(dataset)
        cleaner = cleaner_for(dataset, registration)
        shaft = find_shaft(dataset, registration)
        assert shaft is not None
        np.testing.assert_array_equal(shaft.axis, [0.0, 0.0, -1.0])
        sequence = dataset.sequence("poke-top-01")
        tools = tool_poses(
            sequence.kinematics, sequence.cloud_times, registration.phantom_from_robot, shaft
        )
        outside = total = 0
        for index in range(0, len(sequence), 8):
            found = cleaner.clean(sequence.cloud(index), tools[index])
            outside += int((box_distance(found.points, dataset.config.size) > 3e-3).sum())
            total += len(found.points)
            assert found.counts["kept"] > 1800
        assert outside < 1e-3 * total


def test_parts_of_the_tool_beyond_its_stated_size_go_where_they_stand_clear(scene):
    centre = np.array([0.008, -0.004, SIZE[2] + 0.006])
    view = scene(tool=tuple(centre), tool_radius=7e-3, pixels=150).look(seed=3)
    cleaner = Cleaner(geometry=PHANTOM, phantom_from_camera=view.pose, tool_radius=5e-3, noise=4e-4)
    found = cleaner.clean(view.cloud, ToolPose(centre, ToolShaft(UP, RADIUS)))
    heights = view.pose.apply(view.cloud)[:, 2] - SIZE[2]
    clear = np.flatnonzero((view.label == SPHERE) & (heights > 3e-3))
    assert len(clear) > 20
    assert np.isin(clear, found.indices).mean() < 0.02
    assert kept(found, view.label, BLOCK) > 0.93
