from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from evaluating import evaluator_of
from pushed_block import GRID, POSE, SETUP, SIZE, TOP, dwelling, observed, poke, registration
from small_dataset import write_valid_dataset
from virtual_push import hide, simulate_push

from palpate.dataset import Forces, open_dataset
from palpate.dataset.tool_smoothing import SMOOTHING
from palpate.diagnosis.criteria import CRITERIA
from palpate.diagnosis.forward.jacobian import TOOL_COLUMNS, JacobianRequest
from palpate.diagnosis.forward.prediction import predict
from palpate.diagnosis.forward.worker_pool import Workers
from palpate.diagnosis.inference.credible_intervals import modulus_interval
from palpate.diagnosis.inference.evaluate import Evaluator
from palpate.diagnosis.inference.final_fit import refine
from palpate.diagnosis.inference.gauss_newton import refit
from palpate.diagnosis.inference.hypothesis import Model
from palpate.diagnosis.observation.force_record import (
    ForceComparison,
    ForceRecord,
    force_discrepancy,
    force_scatter,
)
from palpate.diagnosis.observation.frame_groups import Group, Observations
from palpate.diagnosis.report.report import report_of
from palpate.diagnosis.search.findings import Findings
from palpate.effects.elastic_material import StiffInclusion, YoungModulus
from palpate.effects.geometry import GeometryScale
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.frames import Transform
from palpate.mesh.graded_mesh import REPLAY_GRID
from palpate.registration.pose import small_motion
from palpate.replay.replay import replay
from palpate.setup.setup import Inclusion, Setup, Tool

RATE, NOISE, DRIFT = 250.0, 20e-3, 2e-3
BIAS = np.array([0.05, -0.03, 0.02])
CENTRES = np.array([poke(-8e-3), poke(2e-3), poke(4e-3), poke(-8e-3)])
TRUE = 7.5e3


def _pushes(
    seed: int, noise: float = NOISE, drift: float = DRIFT
) -> tuple[Forces, FloatArray, np.ndarray]:
    """Readings over 30 s, the force that was there (n, 3) [N], and at which stamps it was none:
    four pushes of 3 s.
    """
    random = np.random.default_rng(seed)
    time = np.arange(0, 30, 1 / RATE)
    size = np.zeros(len(time))
    for start in (4.0, 10.0, 16.0, 22.0):
        size += 0.3 * np.clip(1.5 - np.abs(time - start - 1.5), 0.0, 0.5)
    force = size[:, None] * np.array([0.3, -0.2, 0.9])
    walk = np.cumsum(random.normal(size=force.shape) * drift / np.sqrt(RATE), axis=0)
    return (
        Forces(time, force + BIAS + walk + noise * random.normal(size=force.shape)),
        force,
        size == 0,
    )


def test_wandering_bias_is_removed_and_its_variance_is_stated():
    misses, stated = [], []
    for seed in range(30):
        forces, truth, untouched = _pushes(seed)
        record = ForceRecord.of(forces, untouched)
        assert record is not None
        middle = np.array([5.5, 11.5, 17.5, 23.5])
        found, strayed = record.at(middle)
        misses.append(found - truth[np.searchsorted(forces.time, middle)])
        stated.append(record.white + strayed)
    assert np.std(misses) == pytest.approx(np.sqrt(np.mean(stated)), rel=0.2)
    assert abs(np.mean(misses)) < 2e-3


def test_noise_of_an_average_is_that_of_the_samples_in_it():
    forces, _, untouched = _pushes(0, drift=0.0)
    record = ForceRecord.of(forces, untouched)
    assert record is not None
    assert np.sqrt(record.white) == pytest.approx(NOISE / np.sqrt(2 * SMOOTHING * RATE), rel=0.1)
    assert record.bias_variance.max() < (1.5 * NOISE / np.sqrt(RATE)) ** 2


def test_sensor_that_is_never_clear_of_the_block_gives_no_record():
    forces, _, untouched = _pushes(0)
    assert ForceRecord.of(forces, np.zeros_like(untouched)) is None


def test_force_is_unknown_beyond_the_stream():
    forces, _, untouched = _pushes(0)
    record = ForceRecord.of(forces, untouched)
    assert record is not None
    assert np.isnan(record.at(np.array([-1.0, 31.0]))[0]).all()


def _felt(item: Observations, force: FloatArray, setup: Setup = SETUP) -> Observations:
    """With a sensor that felt these forces (g, 3) [N], phantom frame, in the groups, without
    noise."""
    index = np.minimum((item.kinematics.time / (2 * item.times[0])).astype(int), len(force) - 1)
    stream = force[index] @ setup.phantom_from_robot.rotation
    return replace(
        item, forces=ForceRecord(item.kinematics.time, stream, 1e-6, np.zeros(len(stream)))
    )


@pytest.fixture(scope="module")
def item() -> Observations:
    forces = np.array([frame.force for frame in replay(SETUP, CENTRES, GRID)])
    return _felt(observed(SETUP, CENTRES, noise=0.0, count=600), forces)


STEP, TIGHT = 1e-5, 1e-9
PIVOT = np.array([0.0, 0.0, TOP])
LUMP = Inclusion(x=5e-3, y=0.0, z=0.024, radius=7e-3, stiffness_ratio=5.0)
(RATIO,) = (item for item in StiffInclusion.parameters() if item.name == "stiffness_ratio")
STIFFER, LATER = (
    YoungModulus(E=5.005e3).apply(SETUP),
    replace(SETUP, sensor=replace(SETUP.sensor, time_offset=1e-4)),
)
WANTED = JacobianRequest(
    setups=(replace(SETUP, tool=Tool(radius=5.0003e-3)), STIFFER, LATER),
    steps=(3e-7, float(np.log(1.001)), 1e-4),
    lumps=(LUMP,),
    pivot=PIVOT,
)
CHANGED = {
    **{
        f"tool along {'xyz'[axis]}": (
            axis,
            replace(SETUP, tool=Tool(radius=5e-3, offset=tuple(STEP * np.eye(3)[axis]))),
            STEP,
        )
        for axis in range(3)
    },
    **{
        f"robot turned about {'xyz'[axis]}": (
            3 + axis,
            replace(
                SETUP,
                phantom_from_robot=small_motion(
                    np.append(np.zeros(3), 2e-3 * np.eye(3)[axis]), PIVOT
                ),
            ),
            2e-3,
        )
        for axis in range(3)
    },
    "radius": (TOOL_COLUMNS, replace(SETUP, tool=Tool(radius=5e-3 + STEP)), STEP),
    "modulus": (TOOL_COLUMNS + 1, YoungModulus(E=5e3 * float(np.exp(1e-3))).apply(SETUP), 1e-3),
    "lump": (
        TOOL_COLUMNS + 3,
        replace(
            SETUP,
            material=replace(
                SETUP.material, inclusions=(replace(LUMP, stiffness_ratio=RATIO.value(0.01)),)
            ),
        ),
        0.01,
    ),
}


@pytest.mark.parametrize("name", CHANGED)
def test_column_of_the_force_is_the_difference_of_two_predictions(item, name):
    column, mean_square_change, step = CHANGED[name]
    here = predict(item, SETUP, GRID, WANTED, tolerance=TIGHT)
    there = predict(item, mean_square_change, GRID, None, here.equilibria, TIGHT, here.samples)
    assert here.forces is not None and there.forces is not None
    wanted, found = (there.forces.gap - here.forces.gap) / step, here.forces.columns[..., column]
    assert np.linalg.norm(wanted) > 0
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


def test_wrong_clock_shifts_force_and_place_alike(item):
    forces = predict(item, SETUP, GRID, WANTED).forces
    assert forces is not None and not forces.columns[..., TOOL_COLUMNS + 2].any()


def test_measured_force_is_rotated_into_the_phantom_frame(item):
    turned = replace(
        SETUP,
        phantom_from_robot=Transform.from_vector(np.zeros(3), np.array([0.0, 0.0, 0.5 * np.pi])),
    )
    measured, deviation = item.force_in_groups(SETUP.phantom_from_robot, 0.0) or (None, None)
    along, _ = item.force_in_groups(turned.phantom_from_robot, 0.0) or (None, None)
    assert measured is not None and along is not None and deviation is not None
    assert np.allclose(along, np.stack([-measured[:, 1], measured[:, 0], measured[:, 2]], axis=1))
    assert np.allclose(deviation, 1e-3)


def test_engine_error_is_one_factor_for_each_push():
    force = np.array([[0, 0, 0], [0, 0, 0.2], [0, 0.1, 0.3], [0, 0, 0], [0.4, 0, 0]], dtype=float)
    forces = ForceComparison(0 * force, np.full(5, 1e-3), force, np.zeros((5, 3, 0)))
    still, pressed = (replay(SETUP, centre[None], GRID)[0] for centre in (poke(-8e-3), poke(2e-3)))
    columns = force_discrepancy(forces, [still, pressed, pressed, still, pressed])
    assert columns.shape == (5, 3, 2)
    assert (
        np.allclose(columns[1:3, :, 0], CRITERIA.force_error.push_error * force[1:3])
        and not columns[3:, :, 0].any()
    )
    assert (
        np.allclose(columns[4, :, 1], CRITERIA.force_error.push_error * force[4])
        and not columns[:4, :, 1].any()
    )
    assert np.allclose(force_scatter(forces)[0], 1e-6)


DEPTHS = (2.5e-3, 5e-3)
QUICK = replace(REPLAY_GRID, spacing=1.4e-3)
LUMPS = (LUMP, replace(LUMP, x=-0.015))


def _sequence(name: str, side: bool, depth: float) -> Observations:
    """A block of TRUE stiffness as the virtual bench knows it: another mesh, element and law than
    the replay's.
    """
    (solved,) = simulate_push(
        hide("young_modulus", E=TRUE), depth=depth, side=side, fine=2.8e-3
    ).solved_pushes
    arcs = solved.segments[0].arcs[-1] - np.array([depth + 3e-3, depth - DEPTHS[0], 0.0])
    times, stream = dwelling(solved.push.place(arcs))
    groups = []
    for number, arc in enumerate(arcs):
        points = _cloud(
            solved.rest, solved.faces, solved.segments[0].surface(float(arc)), 10 * side + number
        )
        groups.append(Group((number,), points, number == 0, push=min(number, 1)))
    force = -solved.segments[0].tool_force(arcs)
    item = Observations(name, times, stream, tuple(groups))
    return _felt(item, force + 3e-3 * np.random.default_rng(int(side)).standard_normal(force.shape))


def _cloud(rest: FloatArray, faces: IntArray, moved: FloatArray, seed: int) -> FloatArray:
    """Points (n, 3) [m] of the sides that face the camera, with noise along the rays, camera frame;
    `moved` (s, 3) [m].
    """
    random = np.random.default_rng(seed)
    middle = rest[faces].mean(axis=1)
    facing = (middle[:, 2] > TOP - 1e-6) | (middle[:, :2] < 1e-6 - np.array(SIZE[:2]) / 2).any(
        axis=1
    )
    first, second, third = (rest + moved)[faces[facing]].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(second - first, third - first), axis=1)
    chosen = random.choice(len(area), 3000, p=area / area.sum())
    share = random.dirichlet([1.0, 1.0, 1.0], len(chosen))
    points = POSE.inverse().apply(
        np.einsum("na,nai->ni", share, (rest + moved)[faces[facing]][chosen])
    )
    return np.asarray(
        points
        * (1 + 3e-4 * random.standard_normal(len(points)) / np.linalg.norm(points, axis=1))[:, None]
    )


@pytest.fixture(scope="module")
def evaluator() -> Iterator[Evaluator]:
    """Two short sequences with forces, each with a clear tool first, and two pushes."""
    data = [_sequence("poke-01", False, DEPTHS[1]), _sequence("side-01", True, DEPTHS[1])]
    with Workers(data, 1) as workers:
        names = [item.name for item in data]
        yield evaluator_of(
            SETUP, registration(), workers, names, None, QUICK, QUICK.finer(), forces=True
        )


@pytest.fixture(scope="module")
def baseline(evaluator) -> Model:
    return evaluator.baseline((), LUMPS)


def test_forces_identify_the_modulus_whatever_was_stated(evaluator, baseline):
    interval = modulus_interval(evaluator, baseline)
    assert interval is not None
    value, low, high = interval
    assert value == pytest.approx(TRUE, rel=0.1)
    assert low < TRUE < high < 1.5 * low


def test_report_has_the_modulus_that_the_forces_identify(evaluator, baseline, tmp_path):
    dataset = open_dataset(write_valid_dataset(tmp_path / "small-block"))
    report = report_of(dataset, evaluator, Findings(baseline), None, "test")
    assert report["not_identifiable"] == []
    (entry,) = report["identified"]
    assert entry["effect"] == "young_modulus" and entry["stated"] == 5e3
    told = entry["parameters"]["E"]
    assert told["unit"] == "Pa" and told["low"] < told["value"] < told["high"]
    assert told["value"] == pytest.approx(TRUE, rel=0.1)
    assert "young_modulus" in {row["effect"] for row in report["ranking"]}


def test_stated_accuracy_of_the_height_is_part_of_the_modulus_interval(
    evaluator, baseline, tmp_path
):
    sigma = 3e-3
    uncertain = Evaluator(replace(evaluator.problem, height_sigma=sigma), evaluator.workers)
    uncertain.state = evaluator.state
    dataset = open_dataset(write_valid_dataset(tmp_path / "small-block"))
    found = [
        report_of(dataset, one, Findings(baseline), None, "test") for one in (evaluator, uncertain)
    ]
    without, told = [report["identified"][0]["parameters"]["E"] for report in found]
    assert "height is stated to 3.0\xa0mm" in found[1]["identified"][0]["why"]
    spread = [np.log(one["high"] / one["low"]) / 2 / 1.96 for one in (without, told)]
    # The same push into a block that is a little higher takes less force. Where the surface lies is
    # known from the camera and the touches, so that the tool goes as deep.
    higher = GeometryScale(scale_x=1.0, scale_y=1.0, scale_z=1.0 + sigma / SIZE[2]).apply(SETUP)
    place = np.array([poke(2e-3)])
    raised = place + np.array([0.0, 0.0, sigma])
    (before,), (after,) = replay(SETUP, place, GRID), replay(higher, raised, GRID)
    change = np.log(np.linalg.norm(before.force) / np.linalg.norm(after.force))
    wider = np.sqrt(spread[1] ** 2 - spread[0] ** 2)
    assert 0.5 * change < wider < 2.0 * change
    assert without["low"] > told["low"] and without["high"] < told["high"]


def test_another_modulus_gains_what_the_stated_one_costs(evaluator, baseline):
    model = refit(evaluator, [YoungModulus.neutral(SETUP)], baseline.predictions)
    assert model.setup.material.young_modulus == pytest.approx(
        TRUE, rel=0.12
    )  # the rest lies within what was stated
    refined = refine(evaluator, model)
    assert refined.setup.material.young_modulus == pytest.approx(TRUE, rel=0.1)
    gain = evaluator.score(model).sum() - evaluator.score(baseline).sum()
    assert gain > 25.0


def test_without_forces_the_modulus_is_not_reported(baseline):
    with Workers([], 1) as workers:
        other = evaluator_of(SETUP, registration(), workers, ["poke-01"], None, QUICK, QUICK)
    assert modulus_interval(other, baseline) is None
    assert len(other.problem.nuisances.precision) == 15
