from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from core.batch.blocks import Blocks, balls_of, blocks_of, frame_of
from core.batch.contact import Balls
from core.batch.slabs import factorise
from core.fem.model import BlockModel, Probe
from core.mesh import GridSpec, box_mesh
from core.setup import Box, Fibres, Inclusion, Layer, Load, Material, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
STATED = Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
LUMP = Inclusion(x=0.01, y=0.0, z=0.025, radius=8e-3, stiffness_ratio=10.0)
SETUPS = [
    STATED,
    replace(STATED, material=Material(poisson_ratio=0.48, stretch_limit=2.0), load=Load(specific_weight_over_stiffness=2.0)),
    replace(STATED, material=Material(inclusions=(LUMP,), fibres=Fibres(direction=0.4, stiffness_ratio=3.0))),
    replace(STATED, material=Material(layer=Layer(thickness=3e-3, stiffness_ratio=4.0), log_ratio=0.5)),
]
CPU = torch.device("cpu")
GRIDS = [GridSpec(nodes=(7, 5, 5), spacing=4e-3), GridSpec(nodes=(5, 7, 5), order=2)]
BOTH_ORDERS = pytest.mark.parametrize("grid", GRIDS, ids=["linear", "quadratic"])


def _deformed(grid: GridSpec, amplitude: float = 2e-4) -> tuple[list[BlockModel], list[np.ndarray], list[Probe]]:
    """Blocks in disorder, each with a ball of its own in its top."""
    rng = np.random.default_rng(3)
    models, places, probes = [], [], []
    for number, setup in enumerate(SETUPS):
        mesh = box_mesh(SIZE, grid, np.array([2e-3 * number, 0.0, SIZE[2]]))
        models.append(BlockModel(setup, mesh))
        moved = np.asarray(amplitude * rng.standard_normal(mesh.nodes.shape))
        moved[mesh.base_nodes] = 0.0
        places.append(mesh.nodes + moved)
        probes.append(Probe(np.array([2e-3 * number, 1e-3, SIZE[2] + 4e-3]), 5e-3 + 2e-4 * number))
    return models, places, probes


def _batch(grid: GridSpec) -> tuple[list[BlockModel], list[np.ndarray], list[Probe], Blocks, Balls, torch.Tensor]:
    models, places, probes = _deformed(grid)
    return (
        models,
        places,
        probes,
        blocks_of(models, frame_of(models[0], CPU)),
        balls_of(probes, CPU),
        torch.as_tensor(np.stack(places)),
    )


@BOTH_ORDERS
def test_energies_are_those_of_each_block_alone(grid):
    models, places, probes, blocks, balls, positions = _batch(grid)
    wanted = [model.energy(place, probe) for model, place, probe in zip(models, places, probes, strict=True)]
    assert np.allclose(blocks.energy(positions, balls).numpy(), wanted, rtol=1e-11, atol=0)


def test_energy_of_an_inverted_or_overstretched_block_is_infinite_and_of_no_other():
    models, places, probes = _deformed(GRIDS[0])
    middle = len(places[0]) // 2
    places[0][middle] += (0.0, 0.0, 0.05)
    places[1] = models[1].mesh.nodes * (1.0, 1.0, 3.0)  # past J_m = 2, but not inside out
    found = blocks_of(models, frame_of(models[0], CPU)).energy(torch.as_tensor(np.stack(places)), balls_of(probes, CPU))
    assert torch.isinf(found).tolist() == [True, True, False, False]


@BOTH_ORDERS
def test_residual_push_and_penetration_are_those_of_each_block_alone(grid):
    models, places, probes, blocks, balls, positions = _batch(grid)
    state = blocks.state(positions, balls)
    for number, (model, place, probe) in enumerate(zip(models, places, probes, strict=True)):
        wanted = model.assemble(place, probe, tangent=False)
        found = state.residual[number].numpy()[model.topology.free]
        assert np.allclose(found, wanted.residual, rtol=0, atol=1e-12 * np.abs(wanted.residual).max())
        assert np.allclose(state.push[number].numpy(), wanted.push, rtol=1e-10) and wanted.push.any()
        assert float(state.penetration[number]) == pytest.approx(wanted.penetration, rel=1e-10)


@BOTH_ORDERS
@pytest.mark.parametrize("bending", [True, False])
def test_factor_in_slabs_solves_the_tangent_of_each_block_alone(grid, bending):
    models, places, probes, blocks, balls, positions = _batch(grid)
    data = blocks.tangent(positions, balls, torch.full((len(models),), float(bending), dtype=torch.float64), torch.float64)
    data[:, blocks.frame.layout.diagonal] += 1.0  # disorder may be indefinite
    factor = factorise(blocks.frame.layout, data)
    right = torch.as_tensor(np.random.default_rng(4).standard_normal(positions.shape))
    found = factor.solve(right)
    assert bool(factor.sound.all())
    for number, (model, place, probe) in enumerate(zip(models, places, probes, strict=True)):
        top, state = model.topology, model.assemble(place, probe, bending=bending)
        state.data[top.diagonal] += 1.0
        top.factor.factorise(state.data)
        wanted = top.factor.solve(right[number].numpy()[top.free])
        assert np.allclose(found[number].numpy()[top.free], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
        assert not found[number].numpy()[~top.free].any()


def test_matrix_that_is_not_positive_definite_is_told_and_spoils_no_other():
    models, _, probes = _deformed(GRIDS[0])
    blocks, balls = blocks_of(models, frame_of(models[0], CPU)), balls_of(probes, CPU)
    rest = blocks.loads.rest
    data = blocks.tangent(rest, balls, torch.zeros(len(models), dtype=torch.float64), torch.float64)
    data[2, blocks.frame.layout.diagonal[7]] = -1.0
    factor = factorise(blocks.frame.layout, data)
    assert factor.sound.tolist() == [True, True, False, True]
    assert bool(torch.isfinite(factor.solve(torch.ones_like(rest))[[0, 1, 3]]).all())


@BOTH_ORDERS
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32], ids=str)
def test_nothing_on_the_way_leaves_the_device(grid, dtype):
    """On torch's device without memory: tensors of two devices cannot be combined."""
    models, places, probes = _deformed(grid)
    device = torch.device("meta")
    blocks, balls = (
        blocks_of(models, frame_of(models[0], device)).pick(torch.tensor([0, 2], device=device)),
        balls_of(probes[:2], device),
    )
    positions = torch.as_tensor(np.stack(places[:2]), device=device)
    state = blocks.state(positions, balls)
    data = blocks.tangent(positions, balls, torch.ones(2, dtype=dtype, device=device), dtype)
    factor = factorise(blocks.frame.layout, data)
    step = factor.solve(state.residual)
    found = (blocks.energy(positions, balls), state.misfit, data, factor.sound, step)
    assert {tensor.device.type for tensor in found} == {"meta"}
    assert (data.dtype, step.dtype) == (dtype, torch.float64)
