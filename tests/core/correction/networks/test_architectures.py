from __future__ import annotations

import numpy as np
import pytest
import torch
from shapes import dome, filled_box
from torch import nn

from palpate.correction import Body, NetworkSpec, build
from palpate.correction.networks.unet import PaddedConvolution, UNet, max_pool, max_pool_by_halves
from palpate.correction.networks.unet_inference import UNetInference
from palpate.foundation.errors import CorrectionError
from palpate.setup.box import Box

SIZE = (0.0687, 0.0393, 0.0358)
BLOCK, DOME = Box(size=SIZE), dome((0.04, 0.03, 0.025))
SMALL = (4, 6, 8)
GRIDS = [(13, 5, 5), (25, 9, 9), (4, 3, 2)]
KINDS = ["unet2d", "unet3d", "graph"]


def _body(kind, nodes):
    return Body.of(BLOCK, nodes).over(BLOCK) if kind == "unet2d" else Body.of(BLOCK, nodes)


def _with_output(spec, body):
    """Return a network whose last layer is not zero."""
    network = build(spec, body)
    torch.manual_seed(1)
    for parameter in network.inside.last.parameters():
        nn.init.normal_(parameter, std=3.0)
    return network


def _inputs(body, frames=2, seed=0):
    generator = torch.Generator().manual_seed(seed)
    rest = torch.as_tensor(body.rest, dtype=torch.float32)
    tool = torch.cat([torch.tensor([0.01, 0.0, 0.04]), torch.randn(10, generator=generator)])
    return rest + 1e-3 * torch.randn((frames, *rest.shape), generator=generator), tool.expand(
        frames, -1
    )


@pytest.mark.parametrize("nodes", GRIDS)
@pytest.mark.parametrize("kind", KINDS)
def test_output_has_the_shape_of_the_input_and_is_bounded(kind, nodes):
    body = _body(kind, nodes)
    vertices, tool = _inputs(body)
    moved = (
        _with_output(NetworkSpec(kind=kind, features=SMALL, trust=0.5), body)(vertices, tool)
        - vertices
    )
    assert moved.shape == vertices.shape
    share = moved.abs().amax(dim=(0, 1)) / torch.as_tensor(body.voxel)
    assert (share <= 0.5 + 1e-5).all()
    assert share.max() > 0.3


@pytest.mark.parametrize("kind", KINDS)
def test_untrained_network_does_not_change_the_simulation(kind):
    body = _body(kind, (13, 5, 5))
    vertices, tool = _inputs(body)
    assert torch.equal(
        build(NetworkSpec(kind=kind, features=SMALL), body)(vertices, tool), vertices
    )


def test_unet_of_the_paper_has_its_layers():
    inside = build(NetworkSpec(kind="unet2d"), Body.of(BLOCK, (13, 5, 5)).over(BLOCK)).inside
    assert isinstance(inside, UNet)
    widths = [
        [part.weight.shape[0] for part in block.modules() if isinstance(part, PaddedConvolution)]
        for block in inside.down
    ]
    assert widths == [[64, 64], [128, 128], [256, 256]]
    bottom = [
        part.weight.shape[:2] for part in inside.bottom if isinstance(part, PaddedConvolution)
    ]
    assert [tuple(shape) for shape in bottom] == [
        (256, 256 + 7),
        (256, 256),
        (256, 256),
        (256, 256),
    ]
    assert all(
        part.weight.shape[2:] == (3, 3)
        for part in inside.modules()
        if isinstance(part, PaddedConvolution)
    )


@pytest.mark.parametrize("shape", [(2, 1), (13, 5), (1, 1), (4, 2, 2), (2, 1, 1), (3, 1, 4)])
def test_omitted_taps_do_not_change_the_convolution(shape):
    torch.manual_seed(0)
    part = PaddedConvolution(len(shape), 3, 5)
    values = torch.randn(2, 3, *shape)
    plain = (nn.functional.conv2d if len(shape) == 2 else nn.functional.conv3d)(
        values, part.weight, part.bias, padding=1
    )
    assert torch.allclose(part(values), plain, atol=1e-6)


@pytest.mark.parametrize("shape", [(13, 5), (13, 5, 5), (2, 1, 3)])
def test_deterministic_pool_equals_torchs_in_value_and_gradient(shape):
    torch.manual_seed(0)
    one, other = (
        torch.rand(2, 3, *shape, generator=torch.Generator().manual_seed(1)).requires_grad_()
        for _ in range(2)
    )
    weights = torch.rand_like(max_pool(one))
    (max_pool(one) * weights).sum().backward()
    (max_pool_by_halves(other) * weights).sum().backward()
    assert torch.equal(max_pool(one), max_pool_by_halves(other))
    assert one.grad is not None and other.grad is not None
    assert torch.equal(one.grad, other.grad)


def test_every_output_voxel_depends_on_the_tool_and_on_all_voxels():
    torch.manual_seed(0)
    network = UNet((13, 5), 3, 7, SMALL)
    values, known = torch.randn(1, 3, 13, 5), torch.randn(1, 7)
    here = network(values, known)
    assert ((network(values, known + 1) - here).abs().amax(dim=1) > 1e-5).float().mean() > 0.95
    shifted = values.clone()
    shifted[0, :, 0, 0] += 1.0
    assert ((network(shifted, known) - here).abs().amax(dim=1) > 1e-4).float().mean() > 0.9


@pytest.mark.parametrize("kind", KINDS)
def test_network_depends_on_its_specified_inputs_only(kind):
    body = _body(kind, (4, 3, 2))
    vertices, tool = _inputs(body)
    other = tool.clone()
    other[:, 7:] += 5.0
    blind = _with_output(NetworkSpec(kind=kind, features=SMALL), body)
    sensing = _with_output(
        NetworkSpec(kind=kind, features=SMALL, inputs=("pose", "velocity", "force")), body
    )
    assert torch.equal(blind(vertices, tool), blind(vertices, other))
    assert not torch.allclose(sensing(vertices, tool), sensing(vertices, other), atol=1e-7)


def test_graph_network_works_on_tetrahedra():
    body = Body.of_mesh(filled_box(SIZE, 0.014))
    vertices, tool = _inputs(body)
    corrected = _with_output(NetworkSpec(kind="graph", features=SMALL), body)(vertices, tool)
    assert corrected.shape == vertices.shape
    assert not torch.equal(corrected, vertices)


def test_graph_network_does_not_depend_on_the_numbering_of_nodes():
    body = Body.of(BLOCK, (4, 3, 2))
    order = torch.randperm(len(body.rest), generator=torch.Generator().manual_seed(3))
    place = torch.argsort(order)
    turned = Body(
        body.rest[order],
        place.numpy()[body.edges],
        body.voxel,
        place.numpy()[body.corners],
        body.shares,
        None,
        body.index,
    )
    vertices, tool = _inputs(body)
    spec = NetworkSpec(kind="graph", features=SMALL)
    here, there = _with_output(spec, body), _with_output(spec, turned)
    assert torch.allclose(
        here(vertices, tool)[:, order], there(vertices[:, order], tool), atol=1e-7
    )


@pytest.mark.parametrize("nodes", GRIDS)
@pytest.mark.parametrize("kind", ["unet2d", "unet3d"])
def test_fast_inference_gives_the_same_correction(kind, nodes):
    body = _body(kind, nodes)
    network = _with_output(
        NetworkSpec(kind=kind, features=SMALL, inputs=("pose", "force")), body
    ).eval()
    vertices, tool = _inputs(body, 1)
    with torch.no_grad():
        expected, single = (
            network(vertices, tool)[0],
            UNetInference(network, half=False)(vertices[0], tool[0]),
        )
        rough = UNetInference(network, half=True)(vertices[0], tool[0])
        exact = network.double()(vertices.double(), tool.double())[0]
    assert (
        UNetInference(network, half=False)(vertices[0].double(), tool[0].double()) - exact
    ).abs().max() < 1e-12
    # Rounding differs in its order, but is not larger.
    assert (single - exact).abs().max() < 3 * (expected - exact).abs().max()
    assert (rough - expected).square().mean() < 0.05**2 * (expected - vertices[0]).square().mean()


def test_weights_depend_on_the_seed_only():
    body = Body.of(BLOCK, (4, 3, 2)).over(BLOCK)
    first = build(NetworkSpec(features=SMALL), body, seed=4)
    torch.rand(7)
    second, other = (
        build(NetworkSpec(features=SMALL), body, seed=4),
        build(NetworkSpec(features=SMALL), body, seed=5),
    )
    pairs = zip(first.parameters(), second.parameters(), other.parameters(), strict=True)
    same, differs = zip(
        *((torch.equal(a, b), not torch.equal(a, c)) for a, b, c in pairs), strict=True
    )
    assert all(same)
    assert any(differs)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "mlp"}, "unet2d"),
        ({"trust": 0.0}, "trust"),
        ({"inputs": ("smell",)}, "velocity"),
        ({"features": ()}, "features"),
    ],
)
def test_invalid_specification_is_refused(wrong, message):
    with pytest.raises(CorrectionError, match=message):
        NetworkSpec(**wrong)


def test_network_for_another_body_is_refused():
    with pytest.raises(CorrectionError, match="2 axes"):
        build(NetworkSpec(kind="unet2d"), Body.of(BLOCK, (4, 3, 2)))


def test_spec_survives_json():
    spec = NetworkSpec(kind="graph", features=(3, 5), trust=0.25, inputs=("pose", "force"))
    assert NetworkSpec.from_json(spec.to_json()) == spec


@pytest.mark.parametrize("kind", KINDS)
def test_surface_of_a_dome_follows_the_correction_of_the_grid(kind):
    body = Body.of(DOME, (5, 4, 3))
    if kind == "unet2d":
        body = body.over(DOME)
    network = _with_output(NetworkSpec(kind=kind, features=SMALL), body).eval()
    vertices, tool = _inputs(body, frames=1)
    with torch.no_grad():
        moved = (network(vertices, tool) - vertices)[0].numpy()
    assert np.allclose(body.carry(moved[: body.count]), moved, atol=1e-6)
    assert np.abs(moved[body.count :]).max() > 1e-3
    if kind != "graph":
        single = UNetInference(network, half=False)(vertices[0], tool[0]) - vertices[0]
        assert np.allclose(single.numpy(), moved, atol=1e-6)
