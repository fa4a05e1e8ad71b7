"""Predictions whose frames a network has corrected, and the network's tool input by group."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, SETUP, SIZE, dwelling, poke, seen_points

from palpate.diagnosis.forward.prediction import predict
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.evaluation.corrected_prediction import corrected_prediction, tool_inputs
from palpate.foundation.arrays import FloatArray
from palpate.measurement.metrics import paper_distance
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.equilibrium import Equilibrium
from palpate.replay.replay import rest

LIFT = 5e-4


def _lifted(frame: Equilibrium, _: FloatArray) -> Equilibrium:
    """Lift the frame by LIFT at the top, and in proportion to the height below it."""
    step = np.zeros_like(frame.displacement)
    step[:, 2] = LIFT * frame.mesh.nodes[:, 2] / SIZE[2]
    return replace(frame, displacement=frame.displacement + step)


def test_lifted_surface_matches_a_lifted_cloud():
    tool = np.zeros((1, 13))
    points = seen_points(_lifted(rest(SETUP, GridSpec()), tool[0]), 3000, 0.0, 1)
    times, stream = dwelling(np.array([poke(-20e-3)]))
    data = Observations("lifted", times, stream, (Group((0,), points, True),))
    model = predict(data, SETUP, GRID)
    found = corrected_prediction(model, data, SETUP, _lifted, tool)
    top = SETUP.surface().patch_normals[:, 2] > 0.5
    assert np.nanmean(model.gap[0, top]) == pytest.approx(LIFT, rel=0.02)
    assert np.nanmax(np.abs(found.gap[0, top])) < 0.02 * LIFT
    placed = SETUP.phantom_from_camera.apply(points)
    before, after = (
        paper_distance(placed, one.equilibria[0], SETUP.surface()) for one in (model, found)
    )
    assert after < before


def test_tool_input_is_the_mean_over_a_group_and_of_the_first_untouched_group_at_rest():
    times, stream = dwelling(np.array([poke(-20e-3), poke(2e-3), poke(2e-3)]))
    none = np.zeros((0, 3))
    groups = (
        Group((), none, True, True),
        Group((0,), none, True),
        Group((1, 2), none, False, push=1),
    )
    columns = np.arange(39.0).reshape(3, 13)
    inputs = tool_inputs(Observations("push-01", times, stream, groups), columns)
    np.testing.assert_array_equal(inputs, [columns[0], columns[0], columns[1:].mean(axis=0)])
