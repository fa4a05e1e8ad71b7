"""The axis of a tube: its place, its bends, what a report states of it, and where it is tried."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from palpate.effects import StiffInclusion, StiffTube, from_json
from palpate.effects.elastic_material import inclusion_grid
from palpate.setup.setup import Box, Inclusion, Setup, Shape, Tool, Tube
from palpate.synthetic.bodies.organ_shape import organ_surface

SIZE = (0.07, 0.04, 0.036)
SETUP = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
TUBE = StiffTube(
    aside=4e-3,
    z=0.026,
    heading=0.0,
    inclination=0.0,
    bend=0.0,
    sag=0.0,
    radius=3e-3,
    stiffness_ratio=8.0,
)


def _line(tube: StiffTube, setup: Setup = SETUP) -> np.ndarray:
    return np.array(tube.located(setup)["polyline"])


def test_straight_tube_goes_from_side_to_side():
    line = _line(TUBE)
    assert line[:, 1:] == pytest.approx(np.tile([4e-3, 0.026], (len(line), 1)))
    assert line[[0, -1], 0] == pytest.approx([-SIZE[0] / 2, SIZE[0] / 2], abs=2e-4)
    assert len(TUBE.lump(SETUP).polyline) == 2


def test_heading_turns_the_tube_about_the_middle():
    line = _line(replace(TUBE, heading=math.pi / 2))
    assert line[:, 0] == pytest.approx(-4e-3, abs=1e-5)
    assert line[[0, -1], 1] == pytest.approx([-SIZE[1] / 2, SIZE[1] / 2], abs=2e-4)


def test_bend_sag_and_inclination_are_parabolas_along_the_heading():
    tube = replace(TUBE, bend=8.0, sag=-6.0, inclination=0.1)
    line = _line(tube)
    way = line[:, 0]
    assert line[:, 1] == pytest.approx(4e-3 + 4.0 * way**2, abs=2e-5)
    assert line[:, 2] == pytest.approx(0.026 + math.tan(0.1) * way - 3.0 * way**2, abs=2e-5)
    drawn = np.array(tube.lump(SETUP).polyline)
    exact = 4e-3 + 4.0 * np.linspace(drawn[0, 0], drawn[-1, 0], 999) ** 2
    between = np.interp(np.linspace(drawn[0, 0], drawn[-1, 0], 999), drawn[:, 0], drawn[:, 1])
    assert np.abs(between - exact).max() < 1e-4


def test_turned_round_it_is_the_same_tube():
    tube = replace(TUBE, heading=0.3, inclination=0.1, bend=5.0, sag=-2.0)
    other = replace(tube, aside=-4e-3, heading=0.3 - math.pi, inclination=-0.1, bend=-5.0, sag=-2.0)
    assert _line(other)[::-1] == pytest.approx(_line(tube), abs=2e-5)


def test_tube_in_a_free_form_goes_from_surface_to_surface():
    shape = Shape(*organ_surface())
    setup = replace(SETUP, geometry=shape)
    middle = (shape.low + shape.high) / 2
    line = _line(replace(TUBE, aside=0.0, z=float(middle[2]), heading=0.5), setup)
    assert len(line) > 10
    assert shape.outside(line).max() < 3e-4
    assert shape.outside(line[[0, -1]]) == pytest.approx(0.0, abs=1e-3)


def test_tube_that_misses_the_body_has_no_points():
    assert TUBE.located(SETUP)["polyline"] and not _line(replace(TUBE, z=0.2)).size


def test_setup_lists_tubes_apart_from_balls_and_says_nothing_without_any():
    ball = StiffInclusion(x=0.0, y=0.0, z=0.02, radius=6e-3, stiffness_ratio=3.0)
    plain = SETUP.as_dict()["material"]
    assert "tubes" not in plain and plain["inclusions"] == []
    both = TUBE.apply(ball.apply(SETUP)).as_dict()["material"]
    assert [one["radius"] for one in both["inclusions"]] == [6e-3]
    (tube,) = both["tubes"]
    assert set(tube) == {"polyline", "radius", "stiffness_ratio"} and tube["radius"] == 3e-3


def test_tubes_are_screened_through_places_of_the_grid_and_apart():
    places = inclusion_grid(SETUP)
    found = StiffTube.screened(places, SETUP)
    assert 10 < len(found) < 40
    for tube, lump in found:
        assert isinstance(lump, Tube) and lump == tube.lump(SETUP)
        assert tube.stiffness_ratio == 1.0 and tube.z in {place.z for place in places}
    beside = [tube for tube, _ in found if tube.heading == 0.0]
    for number, one in enumerate(beside):
        for other in beside[:number]:
            assert math.hypot(one.aside - other.aside, one.z - other.z) > 7e-3


def test_tubes_around_a_ball_go_through_its_middle_in_all_directions():
    ball = Inclusion(x=0.01, y=-0.004, z=0.025, radius=7e-3, stiffness_ratio=3.0)
    found = StiffTube.around(ball, SETUP)
    assert len({round(tube.heading, 6) for tube, _ in found}) == len(found) >= 8
    for tube, lump in found:
        one, other = np.array(lump.polyline)
        along = (other - one) / np.linalg.norm(other - one)
        apart = np.cross(np.array([ball.x, ball.y, ball.z]) - one, along)
        assert np.linalg.norm(apart) < 1e-9 and tube.radius < ball.radius
    assert StiffInclusion.around(ball, SETUP) == []


def test_phrase_says_kind_size_depth_and_direction():
    tube = replace(TUBE, heading=-0.5)
    assert from_json(tube.to_json()) == tube
    said = StiffTube.phrase(tube.values(), SIZE)
    assert (
        "stiff tube" in said and "under the top" in said and said.endswith("151° from the x axis")
    )
    soft = StiffTube.phrase({**tube.values(), "stiffness_ratio": 0.2, "depth": "9 mm"})
    assert "soft tube" in soft and "its axis 9 mm under the surface" in soft
