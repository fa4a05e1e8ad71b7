"""Speed of correction networks: training samples per second and milliseconds per frame.

They are compared with the same networks and loss in plain torch. The plain network consists of
`nn.Conv2d` or `nn.Conv3d` with the same weights. The plain loss computes all distances between
points and vertices and differentiates through the smallest. Both must agree before times are
reported.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import torch
from rich.table import Table
from torch import Tensor, nn

from benchmarks.cpu_time import timed
from palpate.correction import Batch, Body, CorrectionNetwork, NetworkSpec, SurfaceLoss, build
from palpate.correction.networks.chamfer import Loss
from palpate.correction.networks.unet import PaddedConvolution
from palpate.correction.networks.unet_inference import UNetInference, supports_bfloat16
from palpate.setup.box import Box

__all__ = ["plain_loss", "plain_network", "run", "samples_of"]

SIZE, NODES = (0.0687, 0.0393, 0.0358), (13, 5, 5)
BLOCK = Box(size=SIZE)
BATCH, POINTS, STEPS, FRAMES, CORES = 64, 1024, 4, 30, 2
_AGREE = 2e-3
"""Largest relative difference of gradients in single precision [1]; of two equally near vertices
either may be taken."""


def samples_of(body: Body, count: int, points: int = POINTS, seed: int = 0) -> Batch:
    """Return a batch of dented shapes, and noisy points on a surface that is 1 mm lower.

    The shapes are made up, not simulated.
    """
    rng = np.random.default_rng(seed)
    places = np.column_stack(
        [rng.uniform(-0.03, 0.03, count), rng.uniform(-0.015, 0.015, count), np.full(count, 0.037)]
    )
    away = ((body.rest[None, :, :2] - places[:, None, :2]) ** 2).sum(axis=2)
    dent = np.exp(-away / 0.008**2) * body.rest[:, 2] / SIZE[2]
    down = np.array([0.0, 0.0, -1.0])
    positions = body.rest + 4e-3 * dent[:, :, None] * down
    surface = body.surface(positions + 1e-3 * (body.rest[:, 2:] / SIZE[2]) * down)
    chosen = rng.integers(surface.shape[1], size=(count, points))
    cloud = np.take_along_axis(surface, chosen[:, :, None], axis=1) + rng.normal(
        0, 1e-3, (count, points, 3)
    )
    tool = np.concatenate([places, np.tile([1.0, *[0.0] * 9], (count, 1))], axis=1)
    numbers = torch.full((count, 2), points, dtype=torch.int32)
    shapes, known, measured = (
        torch.as_tensor(part, dtype=torch.float32) for part in (positions, tool, cloud)
    )
    return Batch(shapes, known, measured, numbers)


class _Plain(nn.Module):
    """A U-Net of standard torch layers with the weights of another network."""

    def __init__(self, network: CorrectionNetwork) -> None:
        super().__init__()
        self.outer, inside = network, network.inside
        two = len(network.grid or ()) == 2
        self.pool = (nn.MaxPool2d if two else nn.MaxPool3d)(2, ceil_mode=True)
        convolution = nn.Conv2d if two else nn.Conv3d

        def block(parts: nn.Module) -> nn.Sequential:
            layers: list[nn.Module] = []
            for part in parts.children():
                if isinstance(part, PaddedConvolution):
                    made = convolution(part.weight.shape[1], part.weight.shape[0], 3, padding=1)
                    made.weight, made.bias = part.weight, part.bias
                    layers += [made, nn.ReLU()]
            return nn.Sequential(*layers)

        self.down = nn.ModuleList(block(part) for part in inside.get_submodule("down").children())
        self.bottom, self.doubled = (
            block(inside.get_submodule("bottom")),
            inside.get_submodule("doubled"),
        )
        self.up = nn.ModuleList(block(part) for part in inside.get_submodule("up").children())
        self.last = inside.get_submodule("last")

    def forward(self, values: Tensor, known: Tensor) -> Tensor:
        skips = []
        for part in self.down:
            values = part(values)
            skips.append(values)
            values = self.pool(values)
        spread = known.reshape(*known.shape, *[1] * (values.dim() - 2)).expand(
            -1, -1, *values.shape[2:]
        )
        values = self.bottom(torch.cat([values, spread], dim=1))
        for double, part in zip(self.doubled.children(), self.up, strict=True):
            skip = skips.pop()
            grown = double(values)[
                tuple(slice(length) for length in (*skip.shape[:1], None, *skip.shape[2:]))
            ]
            values = part(torch.cat([grown, skip], dim=1))
        return torch.as_tensor(self.last(values))


def plain_network(network: CorrectionNetwork) -> Callable[[Tensor, Tensor], Tensor]:
    """Return the same function of vertices and tool, computed by `_Plain`."""
    plain = _Plain(network)

    def corrected(vertices: Tensor, tool: Tensor) -> Tensor:
        inside, network.inside = network.inside, plain  # type: ignore[assignment]
        try:
            return torch.as_tensor(network(vertices, tool))
        finally:
            network.inside = inside

    return corrected


def plain_loss(loss: SurfaceLoss, vertices: Tensor, batch: Batch) -> Tensor:
    """Return the one-directional Chamfer distance [mm] by all distances."""
    return torch.cdist(batch.points, loss.surface(vertices)).amin(dim=2).mean() * 1e3


def _gradient(network: CorrectionNetwork, total: Tensor) -> Tensor:
    network.zero_grad(set_to_none=True)
    total.backward()
    return torch.cat(
        [part.grad.flatten() for part in network.parameters() if part.grad is not None]
    )


def _row(kind: str) -> tuple[str, ...]:
    body = Body.of(BLOCK, NODES).over(BLOCK) if kind == "unet2d" else Body.of(BLOCK, NODES)
    network, batch = build(NetworkSpec(kind=kind), body), samples_of(body, BATCH)  # type: ignore[arg-type]
    nn.init.normal_(network.inside.last.weight, std=0.02)
    loss, raw = SurfaceLoss(body, np.ones(len(body.rest)), hold=0.0), batch.positions
    plain = plain_network(network)

    def ours() -> Loss:
        return loss(network(raw, batch.tool), batch, raw)

    def common() -> Tensor:
        return plain_loss(loss, plain(raw, batch.tool), batch)

    here, there = _gradient(network, ours().total), _gradient(network, common())
    apart = float((here - there).norm() / there.norm())
    if not apart < _AGREE:
        raise RuntimeError(
            f"{kind}: gradients of both implementations differ by {apart:.2g}; "
            f"expected less than {_AGREE:g}"
        )
    fused, slow = (
        torch.optim.Adam(network.parameters(), 1e-6, fused=setting) for setting in (True, None)
    )
    fast = _rate(fused, lambda: ours().total)
    # The time of the search does not depend on the correction.
    searched = (
        min(timed(lambda: loss.distances(raw, batch))[1] for _ in range(STEPS)) * fast / BATCH
    )
    times = _frame(network, plain, batch, kind)
    return (
        kind,
        f"{apart:.1e}",
        f"{fast:.0f}",
        f"{_rate(slow, common):.0f}",
        f"{100 * searched:.0f} %",
        *times,
    )


def _rate(optimizer: torch.optim.Optimizer, total: Callable[[], Tensor]) -> float:
    """Return samples per CPU second of the fastest of several steps."""

    def step() -> None:
        optimizer.zero_grad(set_to_none=True)
        total().backward()
        optimizer.step()

    step()
    return BATCH / min(timed(step)[1] for _ in range(STEPS))


def _frame(
    network: CorrectionNetwork, plain: Callable[[Tensor, Tensor], Tensor], batch: Batch, kind: str
) -> tuple[str, ...]:
    """Return the time of one frame [ms].

    On all cores (median, wall time), and on one core (CPU time) in bfloat16 if the CPU has it, in
    single precision, and in plain torch.
    """
    vertices, tool = batch.positions[:1], batch.tool[:1]
    with torch.inference_mode():
        expected = plain(vertices, tool)[0]
        result = UNetInference(network, half=False)(vertices[0], tool[0])
        apart = float((result - expected).abs().max())
        if not apart < 1e-7:
            raise RuntimeError(
                f"{kind}: the fast inference differs by {apart * 1e3:.2g} mm; "
                "expected less than 1e-4 mm"
            )
        kinds: list[Callable[[], object]] = [lambda: plain(vertices, tool)]
        for half in (False, True):
            fast = UNetInference(network, half=half)
            kinds.append(lambda fast=fast: fast(vertices[0], tool[0]))  # type: ignore[misc]
        times = [min(timed(work)[1] for _ in range(FRAMES)) * 1e3 for work in kinds]
        fastest = UNetInference(network)
        with _threads(CORES):
            wall = (
                statistics.median(
                    _wall(lambda: fastest(vertices[0], tool[0])) for _ in range(4 * FRAMES)
                )
                * 1e3
            )
    return (
        f"{wall:.2f}",
        f"{times[2]:.2f}" if supports_bfloat16() else "-",
        f"{times[1]:.2f}",
        f"{times[0]:.2f}",
    )


def _wall(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


@contextmanager
def _threads(count: int) -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _on_cuda() -> list[Table]:
    """Return a table of the same step on CUDA; none without a CUDA device."""
    if not torch.cuda.is_available():
        return []
    table = Table(
        "network",
        "batch",
        "gradients differ",
        "samples/s",
        "bfloat16",
        title=f"correction on {torch.cuda.get_device_name()}",
    )
    for kind in ("unet2d", "unet3d"):
        for count in (BATCH, 8 * BATCH):
            table.add_row(*_cuda_row(kind, count))
    return [table]


def _cuda_row(kind: str, count: int) -> tuple[str, ...]:
    body = Body.of(BLOCK, NODES).over(BLOCK) if kind == "unet2d" else Body.of(BLOCK, NODES)
    batch, gradients = samples_of(body, count), []
    for place in ("cpu", "cuda"):
        network = build(NetworkSpec(kind=kind), body).to(place)  # type: ignore[arg-type]
        with torch.no_grad():
            network.inside.last.weight.copy_(
                0.02 * torch.randn(network.inside.last.weight.shape, generator=_drawn())
            )
        loss, here = (
            SurfaceLoss(body, np.ones(len(body.rest)), hold=0.0, device=place),
            batch.to(torch.device(place)),
        )
        with torch.backends.cudnn.flags(allow_tf32=False):
            gradients.append(
                _gradient(
                    network, loss(network(here.positions, here.tool), here, here.positions).total
                ).cpu()
            )
    apart = float((gradients[1] - gradients[0]).norm() / gradients[0].norm())
    if not apart < _AGREE:
        raise RuntimeError(
            f"{kind}: gradients of CUDA and CPU differ by {apart:.2g}; "
            f"expected less than {_AGREE:g}"
        )
    optimizer, rates = torch.optim.Adam(network.parameters(), 1e-6, fused=True), []
    for mixed in (False, True):

        def total(mixed: bool = mixed) -> Tensor:
            with torch.autocast("cuda", torch.bfloat16, enabled=mixed):
                corrected = network(here.positions, here.tool)
            return loss(corrected.float(), here, here.positions).total

        rates.append(_cuda_rate(optimizer, total, count))
    return (kind, str(count), f"{apart:.1e}", *(f"{rate:.0f}" for rate in rates))


def _drawn() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def _cuda_rate(optimizer: torch.optim.Optimizer, total: Callable[[], Tensor], count: int) -> float:
    """Return samples per second of wall time, with the device synchronised."""
    for steps in (STEPS, 5 * STEPS):
        torch.cuda.synchronize()
        began = time.perf_counter()
        for _ in range(steps):
            optimizer.zero_grad(set_to_none=True)
            total().backward()
            optimizer.step()
        torch.cuda.synchronize()
    return steps * count / (time.perf_counter() - began)


def run() -> list[Table]:
    """Measure on one thread, and frames on two; RuntimeError where a result is wrong."""
    with _threads(1):
        table = Table(
            "network",
            "gradients differ",
            "samples/s",
            "plain",
            "neighbours",
            f"ms a frame, wall, {CORES} threads",
            "ms a frame, bfloat16",
            "ms a frame",
            "plain",
            title=f"correction, {'x'.join(map(str, NODES))}, {POINTS} points, one thread, CPU time",
        )
        for kind in ("unet2d", "unet3d"):
            table.add_row(*_row(kind))
        return [table, *_on_cuda()]
