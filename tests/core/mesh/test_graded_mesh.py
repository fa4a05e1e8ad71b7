from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pytest
from pushed_block import SETUP, poke

from palpate.fem.newton import Outcome
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import MeshError
from palpate.mesh.box_mesh import BoxMesh
from palpate.mesh.graded_mesh import REPLAY_GRID, Grading
from palpate.mesh.grid_axes import sized_axis, split_near
from palpate.replay.replay import replay, rest
from palpate.setup.setup import Box, Detachment, Load, Setup, Support

GRADING = Grading(spacing=1.5e-3, along=0.7, inward=1.2)
SIZE = SETUP.geometry.size
PLACES = {
    "amid the top": (0.0, 0.0, SIZE[2]),
    "near a corner": (0.03, -0.015, SIZE[2]),
    "a side": (SIZE[0] / 2, 0.004, 0.02),
}


@dataclass(frozen=True)
class ConstantMesh:
    """The same mesh for every position of the tool."""

    made: BoxMesh

    def mesh(self, setup: Setup, centre: FloatArray) -> BoxMesh:
        return self.made

    def finer(self) -> ConstantMesh:
        return self


def test_edges_grow_with_the_distance_from_the_focus():
    ends = sized_axis(-0.03, 0.04, 0.01, 1e-3, 0.4)
    assert ends[0] == pytest.approx(-0.03, abs=1e-15)
    assert ends[-1] == pytest.approx(0.04, abs=1e-15)
    assert np.abs(ends - 0.01).min() < 1e-15
    middle, edge = np.abs((ends[1:] + ends[:-1]) / 2 - 0.01), np.diff(ends)
    assert edge == pytest.approx(1e-3 + 0.4 * middle, rel=0.15)


@pytest.mark.parametrize(
    ("low", "high", "focus", "edge", "growth", "longest"),
    [
        (-0.03, 0.04, 0.01, 1e-3, 0.4, 6e-3),
        (0.0, 0.0358, 0.0358, 2.6e-3, 1.0, 0.0125),
        (-0.2, 0.3, -0.2, 2e-3, 2.0, 0.02),
    ],
    ids=["between", "at an end", "long"],
)
def test_edges_stop_growing_at_the_longest(low, high, focus, edge, growth, longest):
    ends = sized_axis(low, high, focus, edge, growth, longest)
    assert (ends[0], ends[-1]) == pytest.approx((low, high), abs=1e-15)
    edges, middle = np.diff(ends), np.abs((ends[1:] + ends[:-1]) / 2 - focus)
    assert (edges > 0).all()
    assert edges.max() < 1.25 * longest
    for side in (ends[ends >= focus - 1e-12], focus - ends[ends <= focus + 1e-12][::-1]):
        steps, begun = np.diff(side), edge + growth * np.abs(side[:-1] - side[0])
        assert not len(steps) or np.allclose(
            steps[begun > 1.3 * longest], steps[-1], rtol=1e-9
        )  # of one length from there on
    assert edges == pytest.approx(np.minimum(edge + growth * middle, longest), rel=0.3)


def test_a_longest_edge_that_is_never_reached_changes_nothing():
    assert sized_axis(-0.03, 0.04, 0.01, 1e-3, 0.4, 1.0) == pytest.approx(
        sized_axis(-0.03, 0.04, 0.01, 1e-3, 0.4), abs=1e-12
    )


def test_an_edge_longer_than_the_longest_is_shortened_to_it():
    assert np.diff(sized_axis(0.0, 0.03, 0.03, 8e-3, 0.5, 3e-3)) == pytest.approx(np.full(10, 3e-3))


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
        assert (
            0.6 < nearest / GRADING.spacing < 2.5
        )  # edges of two such nodes, and growing from there on


def test_places_next_to_each_other_share_a_mesh():
    assert GRADING.mesh(SETUP, np.array([1e-5, 0, 0.04])) is GRADING.mesh(
        SETUP, np.array([-1e-5, 0, 0.04])
    )


def test_a_finer_grading_has_more_nodes_everywhere():
    there = np.array(PLACES["near a corner"])
    assert all(
        more > less
        for more, less in zip(
            GRADING.finer().mesh(SETUP, there).shape, GRADING.mesh(SETUP, there).shape, strict=True
        )
    )


def test_a_larger_tool_gets_larger_elements():
    assert GRADING.for_tool(1e-2) == replace(GRADING, spacing=3e-3)


@pytest.mark.parametrize(
    "wrong",
    [
        {"spacing": 0.0},
        {"along": 0.0},
        {"inward": 11.0},
        {"longest": 0.0},
        {"longest": 1.5},
        {"order": 3},
    ],
    ids=str,
)
def test_impossible_gradings_are_refused(wrong):
    with pytest.raises(MeshError):
        replace(GRADING, **wrong)


def test_a_tool_moves_across_meshes_of_different_shapes():
    """From amid the top towards an edge, where the mesh has fewer elements: the force stays the
    same, up to the mesh's error.
    """
    way = [poke(3e-3) + np.array([x, 0, 0]) for x in np.linspace(0, 0.02, 11)]
    frames = replay(SETUP, np.array(way), GRADING)
    assert all(frame.outcome is Outcome.CONVERGED for frame in frames)
    assert len({frame.mesh.connectivity.count for frame in frames}) > 1
    force = np.array([frame.force[2] for frame in frames])
    assert np.abs(np.diff(force)).max() < 0.06 * force.max()


def test_the_sag_does_not_depend_on_the_focus_of_the_mesh():
    """Under 1.8 /m the block sags by 0.74 mm RMS; without a longest edge a tenth of that depends on
    the focus of the mesh.
    """
    heavy, points = (
        replace(SETUP, load=Load(specific_weight_over_stiffness=1.8)),
        SETUP.geometry.surface_points(),
    )

    def sag(grading: Grading, place: tuple[float, float, float]) -> FloatArray:
        mesh = grading.mesh(heavy, np.array(place))
        return rest(heavy, ConstantMesh(mesh)).move(points) - points

    for grading, least, most in (
        (REPLAY_GRID, 0.0, 15e-6),
        (replace(REPLAY_GRID, longest=1.0), 30e-6, np.inf),
    ):
        found = [sag(grading, place) for place in PLACES.values()]
        apart = max(float(np.sqrt(((a - b) ** 2).sum(axis=1).mean())) for a in found for b in found)
        assert least <= apart < most


def test_elements_are_cut_near_a_place_and_keep_their_ends() -> None:
    ends = np.array([0.0, 0.01, 0.02, 0.04])
    cut = split_near(ends, 0.012, 4e-3, 0.5)
    assert set(ends.tolist()) <= set(cut.tolist())
    assert np.diff(cut) == pytest.approx([5e-3] * 2 + [10e-3 / 3] * 3 + [20e-3 / 3] * 3)
    assert split_near(ends, 0.012, 1.0, 0.5) == pytest.approx(ends)


@pytest.mark.parametrize(("edge", "axis"), [("-y", 1), ("+x", 0)])
def test_mesh_is_finer_where_a_loose_base_begins_to_be_held_and_there_alone(
    edge: Literal["-y", "+x"], axis: int
) -> None:
    stated = replace(SETUP, geometry=Box(size=(0.0687, 0.0393, 0.0358)))
    loose = replace(stated, support=Support(detached=(Detachment(edge=edge, extent=0.013),)))
    above = np.array([0.0, 0.0, 0.04])
    plain, finer = (REPLAY_GRID.mesh(setup, above) for setup in (stated, loose))
    sign = -1 if edge[0] == "-" else 1
    line = sign * (stated.geometry.size[axis] / 2 - 0.013)
    for number, (ends, more) in enumerate(zip(plain.axes, finer.axes, strict=True)):
        if number != axis:
            assert more == pytest.approx(ends)
            continue
        here = int(np.searchsorted(more[::2], line))
        assert more[::2][here] - more[::2][here - 1] < 4.1e-3 < np.diff(ends[::2]).max()
        assert set(ends[::2].round(9).tolist()) <= set(more[::2].round(9).tolist())
