"""A tube that the bench hides: its own field against the catalogue's, and its place in a body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from virtual_push import hide

from palpate.effects import from_json
from palpate.setup.setup import Box, Setup, Tool
from palpate.synthetic import draw_scenario, draw_shape_scenario
from palpate.synthetic.laws.stiffness_fields import beyond_tube, in_tube, points_along, tube_axis

SIZE = (0.0687, 0.0393, 0.0358)
LOW, HIGH = (
    np.array([-SIZE[0] / 2, -SIZE[1] / 2, 0.0]),
    np.array([SIZE[0] / 2, SIZE[1] / 2, SIZE[2]]),
)
MIDDLE = np.zeros(2)
NUMBERS = {
    **{"aside": 3e-3, "z": 0.026, "heading": 0.4, "inclination": 0.1},
    **{"bend": 6.0, "sag": -3.0, "radius": 3.5e-3, "stiffness_ratio": 10.0},
}


def test_axis_is_where_the_catalogues_is():
    hidden = hide("stiff_tube", **NUMBERS)
    effect = from_json({"effect": "stiff_tube", "parameters": NUMBERS})
    setup = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
    line = np.array(effect.located(setup)["polyline"])
    apart = beyond_tube(hidden, line, MIDDLE) + NUMBERS["radius"]
    # An arc of a circle and a parabola of the same curvature in the middle.
    assert apart.max() < 3e-4 and apart[len(line) // 2] < 2e-5


@pytest.mark.parametrize("bent", [{}, {"bend": 0.0, "sag": 0.0}], ids=["arc", "straight"])
def test_points_are_in_the_tube_up_to_its_radius(bent):
    hidden = hide("stiff_tube", **{**NUMBERS, **bent})
    axis = tube_axis(hidden, MIDDLE, np.linspace(-0.03, 0.03, 31))
    assert beyond_tube(hidden, axis, MIDDLE) == pytest.approx(-NUMBERS["radius"], abs=1e-9)
    along = np.gradient(axis, axis=0)
    out = np.cross(along, [0.0, 0.0, 1.0])
    out /= np.linalg.norm(out, axis=1)[:, None]
    for share, inside in ((0.98, True), (1.02, False)):
        places = axis + share * NUMBERS["radius"] * out
        assert (in_tube(hidden, places, MIDDLE) == inside).all()


def test_second_law_tapers_and_keeps_the_axis():
    hidden = hide("stiff_tube", **NUMBERS)
    tapered = replace(hidden, second_law=True)
    axis = tube_axis(hidden, MIDDLE, np.array([-0.03, 0.0, 0.03]))
    depths = -beyond_tube(tapered, axis, MIDDLE)
    assert depths[1] == pytest.approx(NUMBERS["radius"])
    assert depths[0] < 0.85 * NUMBERS["radius"] and depths[2] > 1.15 * NUMBERS["radius"]


def test_mesh_is_refined_along_the_axis_within_the_body():
    points = points_along(hide("stiff_tube", **NUMBERS), LOW, HIGH)
    assert len(points) > 15 and ((points > LOW) & (points < HIGH)).all()
    assert np.linalg.norm(np.diff(points, axis=0), axis=1) == pytest.approx(
        NUMBERS["radius"], rel=0.01
    )


def test_drawn_tube_runs_under_the_top_of_the_block_and_is_bent_a_little():
    for seed in range(20):
        (hidden,) = draw_scenario(seed, among=("stiff_tube",)).effects
        points = points_along(hidden, LOW, HIGH)
        assert np.linalg.norm(points[-1] - points[0]) > 0.035
        assert 3.0 <= abs(hidden.value("bend")) <= 7.0


@pytest.mark.parametrize("family", ["liver", "dome"])
def test_drawn_tube_lies_close_under_the_surface_of_a_shape(family):
    drawn = draw_shape_scenario(family, 1, 3, among=("stiff_tube",))
    (hidden,), shape = drawn.scenario.effects, drawn.stated
    points = points_along(hidden, shape.low, shape.high)
    inside = points[shape.outside(points) < 0]
    assert len(inside) > 5
    nearest = -shape.facing(inside)[0] - hidden.value("radius")
    assert nearest.min() < 4e-3
