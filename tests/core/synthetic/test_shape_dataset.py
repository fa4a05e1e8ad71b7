"""Virtual datasets of free forms: the files, the poses, and what the pushes reach."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from palpate.dataset import open_dataset
from palpate.experiment import Experiment
from palpate.foundation.errors import EffectError, SetupError
from palpate.registration.registration import register, setup_from
from palpate.synthetic import HiddenEffect, draw_shape_scenario, make_shape_dataset
from palpate.synthetic.bench.true_body import solid_model
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.bodies.shape_draws import draw_in_shape
from palpate.synthetic.bodies.shape_families import draw_shape
from palpate.synthetic.bodies.shape_mesher import ShapeMesher
from palpate.synthetic.bodies.shape_pushes import (
    is_upright,
    on_one_side,
    push_motion,
    reachable_places,
)


def test_dataset_is_registered_where_it_was_taken(tmp_path: Path) -> None:
    drawn = draw_shape_scenario("kidney", 0, 4)
    drawn = replace(
        drawn, scenario=replace(drawn.scenario, sequences=("poke-top-01", "poke-side-01"), rate=2.0)
    )
    truth = make_shape_dataset(tmp_path / "kidney", drawn, 4)
    experiment = Experiment.of(open_dataset(tmp_path / "kidney"))
    true = truth.phantom_from_camera
    places = experiment.dataset.geometry.surface_points()
    moved = (experiment.registration.phantom_from_camera @ true.inverse()).apply(places)
    assert np.linalg.norm(moved - places, axis=1).mean() < 0.7e-3
    for name in experiment.sequences:
        recorded = experiment.dataset.sequence(name)
        centres = experiment.stated.phantom_from_robot.apply(recorded.kinematics.position)
        gap = experiment.dataset.geometry.gap(centres, 5e-3).min()
        assert -8.5e-3 < gap < -3e-3
        assert len(recorded) > 10


@pytest.mark.parametrize(
    ("robot", "source", "within"),
    [
        ("traces", "traces.csv", 1.0e-3),
        ("matrix", "[robot] phantom_from_robot", 2.0e-3),
        ("hand-eye", "[camera] robot_from_camera", 4.0e-3),
    ],
)
def test_robot_is_registered_without_a_touch(
    tmp_path: Path, robot: str, source: str, within: float
) -> None:
    drawn = draw_shape_scenario("liver", 0, 4)
    scenario = replace(drawn.scenario, sequences=("poke-top-01",), rate=0.5)
    drawn = replace(drawn, scenario=scenario, robot=robot, table=robot == "traces")
    truth = make_shape_dataset(tmp_path / "liver", drawn, 4)
    assert not (tmp_path / "liver" / "touches.csv").exists()
    dataset = open_dataset(tmp_path / "liver")
    cloud = truth.phantom_from_camera.apply(dataset.rest_cloud())
    on_table = (np.abs(cloud[:, 2]) < 3e-3) & (dataset.geometry.outside(cloud) > 10e-3)
    assert (on_table.sum() > 100) == drawn.table and (drawn.table or on_table.sum() < 10)
    found = register(dataset)
    assert found.robot is not None and found.robot.source == source
    places = dataset.geometry.surface_points()
    there = found.phantom_from_robot @ truth.robot_from_phantom
    assert np.linalg.norm(there.apply(places) - places, axis=1).mean() < within
    off = np.concatenate(
        [there.apply(found.robot_pivot[None])[0] - found.robot_pivot, there.rotation_vector]
    )
    assert off @ np.linalg.solve(found.robot_covariance, off) < 22.0  # 6 expected
    setup = setup_from(dataset, found)
    assert (setup.tracing is not None) == (robot == "traces") and not setup.landmarks


def test_rest_surface_is_the_body_s_own() -> None:
    drawn = draw_shape_scenario("dome", 0, 2)
    rest, settled, faces = rest_surface(drawn.scenario, ShapeMesher(drawn.true))
    surface = drawn.stated.surface()
    np.testing.assert_allclose(rest, surface.vertices)
    assert np.array_equal(faces, surface.faces) and np.abs(settled).max() < 1e-9


@pytest.mark.parametrize("family", ["dome", "liver", "kidney", "breast", "cylinder", "grooved"])
def test_pushes_go_in_along_the_normal_and_come_from_above(family: str) -> None:
    shape, rng = draw_shape_scenario(family, 0, 1).stated, np.random.default_rng(0)
    eye = np.array([0.2, 0.2, 0.25])
    for kind in ("poke-top", "poke-side"):
        places, normals = reachable_places(shape, kind, eye, 5e-3)
        assert len(places) > 5
        plan = push_motion(f"{kind}-01", shape, places[:2], normals[:2], 5e-3, rng)
        times = np.linspace(0.0, plan.duration, 400)
        gap = shape.gap(plan.centre(times), 5e-3)
        assert -8.5e-3 < gap.min() < -1e-3 and gap[0] > 5e-3 and gap[-1] > 5e-3


def test_upright_side_is_pushed_by_a_tool_that_leans_away_from_it() -> None:
    shape, rng = draw_shape_scenario("cylinder", 0, 1).stated, np.random.default_rng(0)
    places, normals = reachable_places(shape, "poke-side", np.array([0.2, 0.2, 0.25]), 5e-3)
    assert is_upright(normals) and np.abs(normals[:, 2]).max() < 0.1
    near = on_one_side(normals, 0)
    plan = push_motion("poke-side-01", shape, places[near[:3]], normals[near[:3]], 5e-3, rng)
    # Up the shaft, every point is farther from the body.
    ball = places[near[0]] + 5e-3 * normals[near[0]]
    away = shape.outside(ball - np.linspace(0.0, 0.05, 11)[:, None] * plan.axis)
    assert (np.diff(away) > 1e-3).all() and plan.axis[2] < -0.7
    tops = reachable_places(shape, "poke-top", np.array([0.2, 0.2, 0.25]), 5e-3)
    upright = push_motion("poke-top-01", shape, tops[0][:2], tops[1][:2], 5e-3, rng)
    assert upright.axis.tolist() == [0.0, 0.0, -1.0]


def test_strip_of_a_base_is_loose_inwards_from_the_bodys_own_edge() -> None:
    drawn = draw_shape_scenario("breast", 1, 3, ("base_detachment",))
    strip = HiddenEffect("base_detachment", {"edge": "+x", "extent": 0.014})
    scenario = replace(drawn.scenario, effects=(strip,))
    body = ShapeMesher(drawn.true)(scenario, (), 8e-3)
    model = solid_model(scenario, body)
    base = body.nodes[:, 2] < 1e-9
    inwards = drawn.true.high[0] - body.nodes[:, 0]
    assert np.array_equal(model.held, base & (inwards >= 0.014 - 1e-9)) and model.lifts
    edge = inwards[model.held].min()
    assert 0.014 <= edge < 0.0165  # the mesh is fine at the edge of the strip
    loose = base & ~model.held
    assert loose.sum() > 20


def test_effects_that_a_shape_shows_less_are_drawn_larger_than_in_a_block() -> None:
    shape = draw_shape("kidney", 5)
    sizes = {
        name: [draw_in_shape(shape, 1, seed, (name,))[0] for seed in range(12)]
        for name in ("gravity", "strain_stiffening", "base_detachment", "tool_offset")
    }
    weights = [one.value("specific_weight_over_stiffness") for one in sizes["gravity"]]
    assert 3.0 <= min(weights) < max(weights) <= 4.5
    assert max(one.value("J_m") for one in sizes["strain_stiffening"]) <= 1.0
    for strip in sizes["base_detachment"]:
        axis = "xy".index(str(strip.parameters["edge"])[1])
        share = strip.value("extent") / shape.size[axis]
        assert 0.35 < share <= 0.5 and strip.value("extent") <= 0.0385
    for one in sizes["tool_offset"]:
        length = np.linalg.norm([one.value(axis) for axis in ("dx", "dy", "dz")])
        assert 2.1e-3 < length < 3.6e-3


def test_body_that_slips_is_not_put_back() -> None:
    assert not draw_shape_scenario("dome", 1, 0, ("base_slip",)).scenario.put_back
    assert draw_shape_scenario("dome", 1, 0, ("gravity",)).scenario.put_back


def test_disturbances_of_a_shape_are_those_that_any_body_can_have() -> None:
    drawn = draw_shape_scenario("kidney", 0, 6, (), ("phantom_creep",))
    assert [one.name for one in drawn.scenario.disturbances] == ["phantom_creep"]
    assert not drawn.scenario.effects
    with pytest.raises(EffectError, match="cannot have 'shaft_contact' in a shape; it knows cam"):
        draw_shape_scenario("kidney", 0, 6, (), ("shaft_contact",))


def test_what_no_shape_can_have_is_refused() -> None:
    with pytest.raises(EffectError, match="cannot hide 'landmark_mismatch' in a shape"):
        draw_shape_scenario("dome", 1, 0, ("landmark_mismatch",))
    with pytest.raises(SetupError, match="there is no shape 'cube'; there are dome, liver"):
        draw_shape_scenario("cube", 1, 0)
