"""Correction of the tool's pose by the shaft in the cloud."""

from __future__ import annotations

import numpy as np

from palpate.measurement.tool_pose import ToolPose, ToolShaft, locate_tool
from palpate.registration.faces import box_distance

SIZE = (0.0687, 0.0393, 0.0358)
UP = np.array([0.0, 0.0, 1.0])


def test_the_shaft_in_the_picture_corrects_a_stated_place_across_it(scene):
    centre = np.array([0.005, 0.003, SIZE[2] + 0.001])
    view = scene(tool=tuple(centre), pixels=150).look(seed=5)
    points = view.pose.apply(view.cloud)
    points = points[points[:, 2] > 0.004]
    stated = ToolPose(centre + np.array([0.0015, -0.002, 0.0]), ToolShaft(UP, 4e-3))
    found = locate_tool(points, box_distance(points, SIZE), stated, view.pose.translation, 2e-3)
    assert np.linalg.norm(found.centre - centre) < 0.5 * np.linalg.norm(stated.centre - centre)


def test_a_tool_out_of_the_picture_stays_where_it_was_stated(scene):
    points = np.random.default_rng(0).uniform(-0.03, 0.03, (100, 3))
    stated = ToolPose(np.array([0.0, 0.0, 0.2]), ToolShaft(UP, 4e-3))
    assert (
        locate_tool(points, np.full(100, -0.01), stated, np.array([-0.19, -0.21, 0.26]), 2e-3)
        is stated
    )
