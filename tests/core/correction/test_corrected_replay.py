from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from shapes import dome

from palpate.correction import Body, Corrector, NetworkSpec, TrainedNetwork, build, replay_corrected
from palpate.correction.corrected_replay import FEEDBACKS
from palpate.correction.elastic_extension import ElasticExtension, _tangent
from palpate.correction.samples.tool_columns import tool_columns
from palpate.dataset.tool_smoothing import smooth_centres
from palpate.fem.model import BlockModel
from palpate.foundation.errors import CorrectionError
from palpate.mesh.box_mesh import GridSpec, box_mesh
from palpate.mesh.tet_fill import TetSpec
from palpate.replay.replay import replay
from palpate.setup.setup import Box, Setup, Tool

SIZE, NODES = (0.0687, 0.0393, 0.0358), (13, 5, 5)
BLOCK = Box(size=SIZE)
SETUP = Setup(geometry=BLOCK, tool=Tool(radius=5e-3))
DOME = Setup(geometry=dome((0.03, 0.024, 0.0255)), tool=Tool(radius=5e-3))
GRID = GridSpec(nodes=(9, 7, 6), spacing=2e-3)
WAY = np.array([[0.004, 0.0, SIZE[2] + 5e-3 - depth] for depth in (1e-3, 2e-3, 3e-3)])
TOOLS = np.concatenate([WAY, np.tile([1.0, *[0.0] * 9], (3, 1))], axis=1)


def _trained(kind, body=None, **about):
    """Return an untrained network whose last layer is not zero."""
    whole = Body.of(BLOCK, NODES)
    body = body or (whole.over(BLOCK) if kind == "unet2d" else whole)
    network = build(NetworkSpec(kind=kind, features=(4, 6)), body)
    torch.manual_seed(0)
    for parameter in network.inside.last.parameters():
        torch.nn.init.normal_(parameter, std=0.2)
    seen = np.where(np.isclose(Body.of(BLOCK, NODES).rest[:, 2], SIZE[2]), 5.0, 0.0)
    return TrainedNetwork(
        network.eval(), body, {"force": "simulated", "seen": seen.tolist(), **about}
    )


@pytest.fixture(scope="module")
def frames():
    return replay(SETUP, WAY, GRID, tolerance=1e-3)


@pytest.mark.parametrize("kind", ["unet2d", "unet3d", "graph"])
def test_frame_is_moved_by_the_networks_correction(kind, frames):
    trained = _trained(kind)
    corrector = Corrector(trained, SETUP, half=False)
    tool = torch.as_tensor(TOOLS[-1], dtype=torch.float32)
    tool[10:] = torch.as_tensor(frames[-1].force)
    simulated = torch.as_tensor(frames[-1].move(trained.body.rest), dtype=torch.float32)
    with torch.no_grad():
        expected = (trained.network(simulated[None], tool[None])[0] - simulated).numpy()
    assert np.allclose(corrector.correction(frames[-1], TOOLS[-1]), expected, atol=1e-8)
    corrected = corrector.correct(frames[-1], TOOLS[-1])
    # Both are interpolated between the solved nodes.
    moved = corrected.move(trained.body.rest) - frames[-1].move(trained.body.rest)
    assert np.abs(moved - expected).max() < 0.5 * np.abs(expected).max()
    assert np.sqrt(np.mean((moved - expected) ** 2)) < 0.25 * np.sqrt(np.mean(expected**2))
    assert (corrected.force == frames[-1].force).all()


def test_points_below_a_corrected_top_stay_or_follow(frames):
    still, follows = (
        Corrector(_trained("unet2d"), SETUP, feedback=kind).correct(frames[-1], TOOLS[-1])
        for kind in ("none", "follow")
    )
    below = np.array([[0.0, 0.0, SIZE[2] / 2], [0.01, 0.005, SIZE[2] / 3]])
    top = np.array([[0.0, 0.0, SIZE[2]], [0.02, 0.01, SIZE[2]]])
    assert np.allclose(still.move(below), frames[-1].move(below), atol=1e-12)
    assert np.abs(follows.move(below) - frames[-1].move(below)).max() > 1e-6
    assert np.allclose(still.move(top), follows.move(top), atol=1e-9)


def test_elastic_extension_is_in_equilibrium_and_fixed_at_the_base():
    mesh = box_mesh(SIZE, GridSpec(nodes=(5, 4, 4)))
    top = np.flatnonzero(np.isclose(mesh.nodes[:, 2], SIZE[2]))
    given = np.zeros_like(mesh.nodes)
    given[top] = np.random.default_rng(0).normal(0, 1e-3, (len(top), 3))
    found = ElasticExtension(SETUP, mesh, top)(given)
    model = BlockModel(SETUP, mesh)
    force = np.zeros_like(found)
    force[model.topology.free] = _tangent(model) @ found[model.topology.free]
    between = np.setdiff1d(np.arange(len(mesh.nodes)), [*top, *mesh.base_nodes])
    assert np.allclose(found[top], given[top])
    assert np.allclose(found[mesh.base_nodes], 0.0)
    assert np.abs(force[between]).max() < 1e-12 * np.abs(force[top]).max() * len(found)


def test_small_elastic_extension_agrees_with_the_solver():
    mesh = box_mesh(SIZE, GridSpec(nodes=(5, 4, 4)))
    top = np.flatnonzero(np.isclose(mesh.nodes[:, 2], SIZE[2]))
    given = np.zeros_like(mesh.nodes)
    given[top] = [2e-6, 0.0, -1e-6]
    found = ElasticExtension(SETUP, mesh, top)(given)
    model = BlockModel(SETUP, mesh)
    residual = model.assemble(mesh.nodes + found, None, tangent=False).residual
    there = np.zeros_like(found)
    there[model.topology.free] = residual
    between = np.setdiff1d(np.arange(len(mesh.nodes)), [*top, *mesh.base_nodes])
    assert np.abs(there[between]).max() < 1e-3 * np.abs(there[top]).max()


@pytest.mark.parametrize("kind", ["unet2d", "unet3d"])
def test_equilibrium_does_not_depend_on_the_feedback(kind):
    found = {}
    for feedback in FEEDBACKS:
        corrector = Corrector(_trained(kind), SETUP, feedback=feedback)  # type: ignore[arg-type]
        found[feedback] = list(replay_corrected(corrector, SETUP, WAY, TOOLS, GRID, tolerance=1e-5))
    for one, other in zip(found["none"], found["start"], strict=True):
        assert np.allclose(one.raw.displacement, other.raw.displacement, atol=2e-6)
    assert not np.allclose(
        found["none"][-1].corrected.displacement, found["none"][-1].raw.displacement, atol=1e-5
    )


def test_replay_of_a_dataset_is_corrected_as_its_samples(bench):
    recorder = bench.recorder
    body = bench.samples.body
    trained = _trained("unet3d", body, seen=bench.samples.seen.tolist())
    sequence = bench.dataset.sequence("poke-top-01")
    times, robot = np.asarray(sequence.cloud_times)[:12], recorder.phantom_from_robot
    centres, tools = (
        robot.apply(smooth_centres(sequence.kinematics, times)),
        tool_columns(sequence, times, robot, False),
    )
    corrector = Corrector(trained, recorder.setup, half=False)
    frames = list(replay_corrected(corrector, recorder.setup, centres, tools, recorder.grid))
    batch = bench.samples.batch(bench.samples.rows(["poke-top-01"])[:12])
    with torch.no_grad():
        expected = trained.network(batch.positions, batch.tool)
    for number, frame in enumerate(frames):
        assert np.allclose(frame.corrected.move(body.rest), expected[number], atol=2e-6)


def test_measured_force_is_used_and_a_simulated_one_is_the_frames(frames):
    pushed = TOOLS[-1] + np.append(np.zeros(10), [0.0, 0.0, 3.0])
    for measured in (True, False):
        trained = _trained("graph", force="measured" if measured else "simulated")
        network = build(
            NetworkSpec(kind="graph", features=(4, 6), inputs=("pose", "force")), trained.body
        )
        torch.manual_seed(0)
        for parameter in network.inside.last.parameters():
            torch.nn.init.normal_(parameter, std=0.2)
        corrector = Corrector(replace(trained, network=network), SETUP)
        same = np.allclose(
            corrector.correction(frames[-1], TOOLS[-1]), corrector.correction(frames[-1], pushed)
        )
        assert same is not measured


def test_network_on_a_mesh_corrects_frames_of_that_mesh_only(frames):
    mesh = GridSpec(nodes=(5, 4, 3))
    body = Body.of_mesh(mesh.mesh(SETUP, np.zeros(3)))
    corrector = Corrector(_trained("graph", body), SETUP)
    own = replay(SETUP, WAY[:1], mesh, tolerance=1e-3)[0]
    moved = corrector.correct(own, TOOLS[0]).displacement - own.displacement
    assert np.allclose(moved, corrector.correction(own, TOOLS[0]))
    with pytest.raises(CorrectionError, match="another mesh"):
        corrector.correct(frames[0], TOOLS[0])


def test_unknown_feedback_is_refused():
    with pytest.raises(CorrectionError, match="follow"):
        Corrector(_trained("unet2d"), SETUP, feedback="loud")  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def pushed_dome():
    centres = np.array([[0.004, 0.0, 0.0305 - depth] for depth in (1e-3, 2.5e-3)])
    mesh = TetSpec.along(centres, 5e-3, spacing=3e-3, coarsest=4e-3)
    return replay(DOME, centres, mesh, tolerance=1e-3)[-1]


@pytest.mark.parametrize("kind", ["unet2d", "unet3d", "graph"])
def test_frame_of_a_dome_is_moved_as_the_network_moves_its_sampled_surface(kind, pushed_dome):
    body = Body.of(DOME.geometry, (6, 5, 4))
    if kind == "unet2d":
        body = body.over(DOME.geometry)
    corrector = Corrector(_trained(kind, body), DOME, half=False)
    expected = corrector.correction(pushed_dome, TOOLS[-1])[body.count :]
    corrected = corrector.correct(pushed_dome, TOOLS[-1])
    places = body.rest[body.count :]
    # Next to the base the dome is steep, and the height of its top changes within an element.
    high = places[:, 2] > 6e-3
    places, expected = places[high], expected[high]
    moved = corrected.move(places) - pushed_dome.move(places)
    # The mesh's elements are smaller than the grid's voxels.
    assert np.sqrt(np.mean((moved - expected) ** 2)) < 0.1 * np.sqrt(np.mean(expected**2))
    assert np.sqrt(np.mean(expected**2)) > 1e-4


def test_inside_of_a_dome_follows_its_corrected_surface(pushed_dome):
    body = Body.of(DOME.geometry, (6, 5, 4)).over(DOME.geometry)
    still, follows = (
        Corrector(_trained("unet2d", body), DOME, feedback=kind).correct(pushed_dome, TOOLS[-1])
        for kind in ("none", "follow")
    )
    deep = np.array([[0.004, 0.0, 8e-3], [0.01, 0.005, 5e-3]])
    top = DOME.geometry.surface_points()
    top = top[top[:, 2] > 0.02]
    moved = [np.abs(one.move(deep) - pushed_dome.move(deep)).max() for one in (still, follows)]
    assert moved[0] < 0.1 * moved[1] and moved[1] > 1e-5
    assert np.sqrt(np.mean((still.move(top) - follows.move(top)) ** 2)) < 0.3 * np.sqrt(
        np.mean((still.move(top) - pushed_dome.move(top)) ** 2)
    )
    base = follows.mesh.connectivity.base_nodes
    assert np.allclose(follows.displacement[base], 0.0, atol=1e-9)
