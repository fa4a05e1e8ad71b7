"""A corrected frame: moved where the network says, compared with clouds as any other, and described by what its tool does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import GRID, SETUP, SIZE, dwelling, poke, seen_points

from core.diagnosis.observations import Group, Observations
from core.diagnosis.prediction import predict
from core.evaluation.corrected import corrected_frame, corrected_prediction, tools_of
from core.frames import FloatArray
from core.measurement import Surface
from core.mesh import GridSpec, box_mesh
from core.metrics import paper_distance
from core.replay import rest
from core.setup import Load

SAMPLED = box_mesh(SIZE, GridSpec())
LIFT = 5e-4


def _lifted(points: FloatArray) -> FloatArray:
    """A correction of LIFT at the top that fades to nothing at the base."""
    change = np.zeros_like(points)
    change[..., 2] = LIFT * SAMPLED.nodes[:, 2] / SIZE[2]
    return change


def test_correction_is_interpolated_between_the_points_of_the_grid():
    frame = rest(replace(SETUP, load=Load(specific_weight_over_stiffness=2.0)), GRID)
    moved = corrected_frame(frame, SAMPLED, _lifted(SAMPLED.nodes))
    places = np.random.default_rng(0).uniform((-0.03, -0.015, 0.0), (0.03, 0.015, SIZE[2]), (40, 3))
    step = moved.move(places) - frame.move(places)
    np.testing.assert_allclose(step[:, 2], LIFT * places[:, 2] / SIZE[2], atol=1e-9)
    assert moved.probe is frame.probe and moved.force is frame.force


def test_cloud_that_lies_higher_is_met_by_a_surface_that_is_lifted():
    frame = rest(SETUP, GridSpec())
    points = seen_points(corrected_frame(frame, SAMPLED, _lifted(SAMPLED.nodes)), 3000, 0.0, 1)
    times, stream = dwelling(np.array([poke(-20e-3)]))
    data = Observations("lifted", times, stream, (Group((0,), points, True),))
    model = predict(data, SETUP, GRID)
    tool = np.zeros((1, 13))
    found = corrected_prediction(model, data, SETUP, SAMPLED, lambda at, _: _lifted(at), tool)
    top = Surface.of(SETUP).patch_normals[:, 2] > 0.5
    assert np.nanmean(model.gap[0, top]) == pytest.approx(LIFT, rel=0.02)
    assert np.nanmax(np.abs(found.gap[0, top])) < 0.02 * LIFT
    placed = SETUP.phantom_from_camera.apply(points)
    before, after = (paper_distance(placed, one.equilibria[0], Surface.of(SETUP)) for one in (model, found))
    assert after < before


def test_rest_cloud_is_told_the_tool_of_the_first_untouched_group():
    times, stream = dwelling(np.array([poke(-20e-3), poke(2e-3)]))
    groups = (
        Group((), np.zeros((0, 3)), True, True),
        Group((0,), np.zeros((0, 3)), True),
        Group((1,), np.zeros((0, 3)), False, probe=1),
    )
    data = Observations("told", times, stream, groups)
    columns = np.arange(26.0).reshape(2, 13)
    told = tools_of(_Solved(3), data, columns, measured=True)  # type: ignore[arg-type]
    np.testing.assert_array_equal(told, columns[[0, 0, 1]])
    np.testing.assert_array_equal(tools_of(_Solved(3), data, columns, measured=False)[:, 10:], [[1, 2, 3]] * 3)  # type: ignore[arg-type]


class _Solved:
    """Stands for a prediction, of which only the frames' forces are asked."""

    def __init__(self, count: int) -> None:
        self.equilibria = [replace(rest(SETUP, GridSpec()), force=np.array([1.0, 2.0, 3.0]))] * count
