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
from palpate.synthetic import draw_shape_scenario, make_shape_dataset
from palpate.synthetic.bench.virtual_experiment import rest_surface
from palpate.synthetic.bodies.shape_mesher import ShapeMesher
from palpate.synthetic.bodies.shape_pushes import push_motion, reachable_places


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
    drawn = replace(drawn, scenario=scenario, robot=robot)
    truth = make_shape_dataset(tmp_path / "liver", drawn, 4)
    assert not (tmp_path / "liver" / "touches.csv").exists()
    dataset = open_dataset(tmp_path / "liver")
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
        if kind == "poke-side" and family in ("cylinder", "grooved"):
            continue  # their sides are upright: a tool that hangs from above cannot push them
        assert len(places) > 5
        plan = push_motion(f"{kind}-01", shape, places[:2], normals[:2], 5e-3, rng)
        times = np.linspace(0.0, plan.duration, 400)
        gap = shape.gap(plan.centre(times), 5e-3)
        assert -8.5e-3 < gap.min() < -1e-3 and gap[0] > 5e-3 and gap[-1] > 5e-3


def test_what_no_shape_can_have_is_refused() -> None:
    with pytest.raises(EffectError, match="cannot hide 'tool_friction' in a shape"):
        draw_shape_scenario("dome", 1, 0, ("tool_friction",))
    with pytest.raises(SetupError, match="there is no shape 'cube'; there are dome, liver"):
        draw_shape_scenario("cube", 1, 0)
