"""CUDA gives the same results as the CPU; skipped where there is no CUDA device."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from learned_samples import write_samples

from palpate.correction import (
    NetworkSpec,
    Samples,
    Split,
    SurfaceLoss,
    TrainedNetwork,
    TrainingSpec,
    build,
    sample_errors,
    train,
)
from palpate.correction.networks.chamfer import nearest
from palpate.correction.networks.devices import reproducible
from palpate.correction.samples.sample_store import body_for
from palpate.foundation.errors import Cancelled

pytestmark = pytest.mark.skipif(not torch.cuda.is_available(), reason="no CUDA here")
KINDS = ("unet2d", "unet3d", "graph")
SPEC = TrainingSpec(
    network=NetworkSpec(kind="unet3d", features=(4, 6)),
    rate=5e-3,
    batch=8,
    epochs=5,
    keep_every=2,
    device="cuda",
    threads=1,
)


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Samples:
    return write_samples(tmp_path_factory.mktemp("cuda") / "samples")


def _same(one: TrainedNetwork, other: TrainedNetwork) -> bool:
    weights = zip(
        one.network.state_dict().values(), other.network.state_dict().values(), strict=True
    )
    return all(torch.equal(a.cpu(), b.cpu()) for a, b in weights)


def test_nearest_is_exact():
    generator = torch.Generator().manual_seed(1)
    points, others = (
        torch.randn(5, 900, 3, generator=generator),
        torch.randn(5, 700, 3, generator=generator),
    )
    everything = torch.ones(5, 900, dtype=torch.bool)
    found = nearest(points.cuda(), others.cuda(), everything.cuda())
    assert torch.equal(found.cpu(), nearest(points, others, everything))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("distance", ["chamfer", "symmetric", "hausdorff"])
def test_gradient_equals_the_cpus(samples, kind, distance):
    body, gradients = body_for(samples, kind), []
    for place in ("cpu", "cuda"):
        # With TF32 products in convolutions Hausdorff's distance may choose another, almost
        # equally distant point.
        with reproducible(torch.device(place), 0), torch.backends.cudnn.flags(allow_tf32=False):
            network = build(NetworkSpec(kind=kind, features=(8, 16)), body, 3).to(place)
            for number, weight in enumerate(network.parameters()):
                weight.data += 0.02 * torch.randn(
                    weight.shape, generator=torch.Generator().manual_seed(number)
                ).to(place)
            loss = SurfaceLoss(
                body, samples.seen[body.index], distance=distance, hold=0.5, device=place
            )
            batch = samples.batch(samples.rows(["one"])).to(torch.device(place))
            raw = batch.positions[:, body.index]
            loss(network(raw, batch.tool), batch, raw).total.backward()
        gradients.append(
            torch.cat(
                [
                    weight.grad.flatten().cpu()
                    for weight in network.parameters()
                    if weight.grad is not None
                ]
            )
        )
    assert gradients[0].norm() > 0
    assert (gradients[1] - gradients[0]).norm() < 2e-3 * gradients[0].norm()


@pytest.mark.parametrize("kind", KINDS)
def test_same_seed_gives_the_same_weights_bit_for_bit(samples, kind, tmp_path):
    spec = replace(SPEC, network=NetworkSpec(kind=kind, features=(8, 16)))
    assert _same(
        *(train(samples, Split.of(samples), spec, tmp_path / name) for name in ("first", "second"))
    )


@pytest.mark.parametrize("step", [1, 5])
def test_cancelled_training_resumes_exactly(samples, tmp_path, step):
    calls = iter(range(10**9))

    def stop(fraction: float, text: str) -> None:
        if next(calls) == step:
            raise Cancelled

    whole = train(samples, Split.of(samples), SPEC, tmp_path / "whole")
    with pytest.raises(Cancelled):
        train(samples, Split.of(samples), SPEC, tmp_path / "stopped", stop)
    assert _same(whole, train(samples, Split.of(samples), SPEC, tmp_path / "stopped"))


@pytest.mark.parametrize("mixed", [False, True])
def test_training_reaches_the_error_of_the_cpu(samples, tmp_path, mixed):
    spec = replace(SPEC, epochs=30, patience=30)
    here, there = (
        train(
            samples, Split.of(samples), replace(spec, device=place, mixed=mixed), tmp_path / place
        )
        for place in ("cpu", "cuda")
    )
    assert there.about["error"] < 0.5 * there.about["raw_error"]
    assert there.about["error"] == pytest.approx(here.about["error"], rel=0.05)


def test_network_trained_on_cuda_corrects_alike_on_the_cpu(samples, tmp_path):
    trained = train(samples, Split.of(samples), SPEC, tmp_path)
    rows, errors = samples.rows(["three"]), []
    for place in ("cpu", "cuda"):
        loaded = TrainedNetwork.load(tmp_path, place)
        loss = SurfaceLoss(trained.body, samples.seen[trained.body.index], device=place)
        errors.append(
            sample_errors(loaded.network, loss, trained.body, samples, rows, place).numpy()
        )
    assert np.allclose(errors[0], errors[1], rtol=1e-3)
