from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import SETUP, poke

from core.axes import sized_axis
from core.errors import MeshError
from core.fem.newton import Outcome
from core.grading import Grading
from core.replay import replay

GRADING = Grading(spacing=1.5e-3, along=0.7, inward=1.2)
SIZE = SETUP.box.size
PLACES = {"amid the top": (0.0, 0.0, SIZE[2]), "near a corner": (0.03, -0.015, SIZE[2]), "a side": (SIZE[0] / 2, 0.004, 0.02)}


def test_edges_grow_with_the_distance_from_the_focus():
    ends = sized_axis(-0.03, 0.04, 0.01, 1e-3, 0.4)
    assert ends[0] == pytest.approx(-0.03, abs=1e-15)
    assert ends[-1] == pytest.approx(0.04, abs=1e-15)
    assert np.abs(ends - 0.01).min() < 1e-15
    middle, edge = np.abs((ends[1:] + ends[:-1]) / 2 - 0.01), np.diff(ends)
    assert edge == pytest.approx(1e-3 + 0.4 * middle, rel=0.15)


def test_an_axis_shorter_than_an_edge_is_one_element():
    assert sized_axis(0.0, 1e-3, 1e-3, 5e-3, 0.5).tolist() == [0.0, 1e-3]


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_the_mesh_is_finest_at_the_focus_wherever_that_is(place):
    mesh = GRADING.mesh(SETUP, np.array(place))
    assert mesh.focus == pytest.approx(np.array(place), abs=2e-4)
    for axis, at in zip(mesh.axes, place, strict=True):
        assert axis[0] <= at + 1e-12
        assert axis[-1] >= at - 1e-12
        nearest = np.diff(axis)[np.argmin(np.abs((axis[1:] + axis[:-1]) / 2 - at))]
        assert 0.6 < nearest / GRADING.spacing < 2.5  # edges of two such nodes, and growing from there on


def test_places_next_to_each_other_share_a_mesh():
    assert GRADING.mesh(SETUP, np.array([1e-5, 0, 0.04])) is GRADING.mesh(SETUP, np.array([-1e-5, 0, 0.04]))


def test_a_finer_grading_has_more_nodes_everywhere():
    there = np.array(PLACES["near a corner"])
    assert all(
        more > less for more, less in zip(GRADING.finer().mesh(SETUP, there).shape, GRADING.mesh(SETUP, there).shape, strict=True)
    )


def test_a_larger_tool_wants_larger_elements():
    assert GRADING.for_tool(1e-2) == replace(GRADING, spacing=3e-3)


@pytest.mark.parametrize("wrong", [{"spacing": 0.0}, {"along": 0.0}, {"inward": 11.0}, {"order": 3}], ids=str)
def test_what_makes_no_mesh_is_refused(wrong):
    with pytest.raises(MeshError):
        replace(GRADING, **wrong)


def test_a_tool_is_led_over_meshes_of_different_shapes():
    """From amid the top towards an edge, where the mesh has fewer elements: the force stays what it was, to the mesh's error."""
    way = [poke(3e-3) + np.array([x, 0, 0]) for x in np.linspace(0, 0.02, 11)]
    frames = replay(SETUP, np.array(way), GRADING)
    assert all(frame.outcome is Outcome.CONVERGED for frame in frames)
    assert len({frame.mesh.connectivity.count for frame in frames}) > 1
    force = np.array([frame.force[2] for frame in frames])
    assert np.abs(np.diff(force)).max() < 0.06 * force.max()
