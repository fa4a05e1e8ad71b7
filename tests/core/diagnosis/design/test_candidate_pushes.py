from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pushed_block import SETUP, SIZE, observed, poke

from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.design.candidate_pushes import Push, depth_reached, pushes, speed_reached
from palpate.synthetic.bodies.shape_families import draw_shape

RADIUS, DEPTH = SETUP.tool.radius, 6e-3
DOWN = (0.0, 0.0, -1.0)
PUSHES = pushes(SETUP, DEPTH, drags=True)


def test_every_side_but_the_base_is_tried():
    assert {push.side for push in PUSHES} == {"top", "-x", "+x", "-y", "+y"}
    assert {push.kind for push in PUSHES} == {"top", "side", "drag"}
    assert len({push.place for push in PUSHES if push.kind == "top"}) >= 8


@pytest.mark.parametrize("push", PUSHES, ids=lambda push: push.text())
def test_ball_goes_in_from_where_it_touches_as_deep_as_said(push):
    passing, deep, dragged, released = push.centres(RADIUS)
    gaps = SETUP.geometry.gap(np.array([passing, deep, dragged, released]), RADIUS)
    np.testing.assert_allclose(gaps[:3], [-DEPTH / 2, -DEPTH, -DEPTH], atol=1e-12)
    assert gaps[3] > RADIUS
    assert np.linalg.norm(dragged - deep) == pytest.approx(0.012 if push.kind == "drag" else 0.0)


def test_free_form_is_pushed_along_its_normals_wherever_a_tool_reaches_it():
    shape = draw_shape("liver", 0)
    found = pushes(replace(SETUP, geometry=shape), DEPTH, drags=False)
    assert len(found) > 8 and {push.side for push in found} == {"surface"}
    places = np.array([push.place for push in found])
    assert np.abs(shape.facing(places)[0]).max() < 1e-6
    gaps = np.linalg.norm(places[:, None] - places, axis=2) + np.eye(len(places))
    assert gaps.min() >= CRITERIA.design.spacing
    for push in found:
        assert push.direction[2] < -0.3
        assert shape.gap(push.centres(RADIUS)[3:], RADIUS)[0] > 0
    assert "along the normal of the surface" in found[0].text()


def test_only_what_drags_or_slides_asks_for_drags():
    assert "drag" not in {push.kind for push in pushes(SETUP, DEPTH, drags=False)}


def test_cloud_in_passing_is_late_and_one_in_rest_is_not():
    push = Push(
        kind="top", side="top", into=DOWN, place=(0.0, 0.0, SIZE[2]), depth=DEPTH, speed=0.02
    )
    before, after = push.centres(RADIUS), push.centres(RADIUS, late=0.05)
    assert after[0] - before[0] == pytest.approx([0.0, 0.0, 1e-3])
    np.testing.assert_array_equal(after[1:], before[1:])


def test_text_says_where_and_how():
    push = Push(kind="top", side="top", into=DOWN, place=(0.0121, -0.008, SIZE[2]), depth=DEPTH)
    assert push.text() == "press 6 mm deep on the top at (12, -8) mm"
    assert (
        replace(push, along=(-0.012, 0.0, 0.0), kind="drag")
        .text()
        .endswith("at (12, -8) mm and drag 12 mm along -x")
    )
    assert replace(push, speed=0.03).text().endswith(", going in at 30 mm/s")
    assert "hold for 10 s and look again 10 s after the release" in replace(push, hold=10.0).text()
    assert push.half().text().startswith("press 3 mm deep")


def test_depth_and_speed_are_those_that_were_reached():
    item = observed(SETUP, np.array([poke(-8e-3), poke(1e-3), poke(4e-3)]), count=100, noise=0.0)
    assert depth_reached([item], SETUP) == pytest.approx(4e-3, abs=1e-4)
    assert speed_reached([item], SETUP) > 5e-3
