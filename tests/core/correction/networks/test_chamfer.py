from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy.spatial import cKDTree
from scipy.spatial.distance import directed_hausdorff

from palpate.correction import Batch, Body, SurfaceLoss
from palpate.correction.networks.chamfer import _by_all, hold_weights, nearest
from palpate.foundation.errors import CorrectionError
from palpate.measurement.metrics import paper_distance
from palpate.mesh.box_mesh import GridSpec
from palpate.replay.replay import rest
from palpate.setup.setup import Box, Setup, Tool

SIZE = (0.0687, 0.0393, 0.0358)
BLOCK = Box(size=SIZE)
NODES = (13, 5, 5)


def _cloud(body, frames=3, points=40, seed=0):
    """Return points near the body's surface; some are missing in each frame."""
    rng = np.random.default_rng(seed)
    surface = body.surface(body.rest)
    cloud = surface[rng.integers(len(surface), size=(frames, points))] + rng.normal(
        0, 1e-3, (frames, points, 3)
    )
    count = rng.integers(points // 2, points, frames)
    for row, number in enumerate(count):
        cloud[row, number:] = np.nan
    tool = torch.zeros(frames, 13)
    numbers = torch.as_tensor(np.stack([count, count], axis=1), dtype=torch.int32)
    vertices = torch.as_tensor(body.rest, dtype=torch.float32).expand(frames, -1, -1)
    return Batch(vertices, tool, torch.as_tensor(cloud, dtype=torch.float32), numbers)


def _seen(body):
    return np.where(np.isclose(body.rest[:, 2], SIZE[2]), 5.0, 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_both_nearest_neighbour_searches_are_exact(seed):
    generator = torch.Generator().manual_seed(seed)
    points, others = (
        torch.randn(3, 50, 3, generator=generator),
        torch.randn(3, 70, 3, generator=generator),
    )
    brute = (points[:, :, None].double() - others[:, None].double()).norm(dim=3).argmin(dim=2)
    everything = torch.ones(3, 50, dtype=torch.bool)
    assert torch.equal(nearest(points, others, everything), brute)
    assert torch.equal(_by_all(points, others), brute)


def test_chamfer_is_the_papers_metric():
    body, setup = Body.of(BLOCK, NODES), Setup(geometry=Box(size=SIZE), tool=Tool(radius=5e-3))
    batch = _cloud(body)
    apart, valid = SurfaceLoss(body, _seen(body)).distances(batch.positions, batch)
    frame = rest(setup, GridSpec(nodes=(5, 4, 3)))
    for row in range(len(batch)):
        expected = paper_distance(batch.points[row][valid[row]].numpy(), frame, setup.surface())
        assert apart[row][valid[row]].mean() == pytest.approx(expected, rel=1e-5)


def test_top_layer_is_compared_with_points_of_the_top_only():
    body = Body.of(BLOCK, NODES).over(BLOCK)
    batch = _cloud(body)
    batch.count[:, 0] = 5
    _, valid = SurfaceLoss(body, np.ones(len(body.rest))).distances(batch.positions, batch)
    assert valid.sum(dim=1).tolist() == [5, 5, 5]


@pytest.mark.parametrize("distance", ["chamfer", "symmetric", "hausdorff"])
def test_gradient_is_that_of_finite_differences(distance):
    body = Body.of(BLOCK, (4, 3, 2))
    batch = _cloud(body)
    loss = SurfaceLoss(body, _seen(body), distance=distance, hold=0.5)
    vertices = batch.positions.clone().requires_grad_()
    start = batch.positions
    loss(vertices, batch, start + 1e-4).total.backward()
    way = torch.randn(vertices.shape, generator=torch.Generator().manual_seed(2)) * 2e-6
    ahead, behind = (loss(start + sign * way, batch, start + 1e-4).total.item() for sign in (1, -1))
    assert (vertices.grad * way).sum().item() == pytest.approx((ahead - behind) / 2, rel=0.03)


def test_hausdorff_is_scipys():
    body = Body.of(BLOCK, (4, 3, 2))
    batch = _cloud(body, frames=1)
    loss = SurfaceLoss(body, np.ones(len(body.rest)), distance="hausdorff", hold=0.0)
    surface = body.surface(body.rest)
    cloud = batch.points[0][: int(batch.count[0, 1])].numpy()
    expected = max(directed_hausdorff(surface, cloud)[0], directed_hausdorff(cloud, surface)[0])
    assert loss(batch.positions, batch, batch.positions).distance.item() == pytest.approx(
        expected * 1e3, rel=1e-5
    )


def test_symmetric_distance_adds_visible_surface_to_points():
    body = Body.of(BLOCK, (4, 3, 2))
    batch = _cloud(body)
    one, both = (
        SurfaceLoss(body, _seen(body), distance=kind)(
            batch.positions, batch, batch.positions
        ).distance.item()
        for kind in ("chamfer", "symmetric")
    )
    surface = body.surface(body.rest)
    # The camera sees the top; vertices of the sides count as visible above half the height.
    seen = surface[surface[:, 2] > SIZE[2] / 2 + 1e-9]
    clouds = [batch.points[row][: int(batch.count[row, 1])].numpy() for row in range(len(batch))]
    back = np.mean([np.mean(cKDTree(cloud).query(seen)[0]) for cloud in clouds]) * 1e3
    assert both - one == pytest.approx(back, rel=1e-4)


def test_hidden_points_are_held_and_visible_ones_are_free():
    body = Body.of(BLOCK, NODES)
    batch, seen = _cloud(body), _seen(body)
    loss = SurfaceLoss(body, seen, hold=1.0)
    hidden, shown = batch.positions.clone(), batch.positions.clone()
    hidden[:, np.flatnonzero(seen == 0)] += 1e-3
    shown[:, np.flatnonzero(seen > 0)] += 1e-3
    share = float((seen == 0).mean())
    assert loss(hidden, batch, batch.positions).hidden.item() == pytest.approx(
        3.0 * share, rel=1e-3
    )
    assert loss(shown, batch, batch.positions).hidden.item() < 1e-3


def test_points_without_measurements_have_full_weight():
    assert hold_weights(np.zeros(4)).tolist() == [1.0] * 4
    assert hold_weights(np.array([0.0, 100.0])).round(3).tolist() == [1.0, 0.0]


def test_frame_without_points_has_a_finite_loss_and_gradient():
    body = Body.of(BLOCK, (4, 3, 2))
    batch = _cloud(body)
    batch.count[1] = 0
    for distance in ("chamfer", "symmetric", "hausdorff"):
        vertices = batch.positions.clone().requires_grad_()
        loss = SurfaceLoss(body, _seen(body), distance=distance)(vertices, batch, batch.positions)
        loss.total.backward()
        assert torch.isfinite(loss.total)
        assert torch.isfinite(vertices.grad).all()


def test_unknown_distance_is_refused():
    with pytest.raises(CorrectionError, match="hausdorff"):
        SurfaceLoss(Body.of(BLOCK, (4, 3, 2)), np.ones(24), distance="manhattan")  # type: ignore[arg-type]
