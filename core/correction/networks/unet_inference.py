"""Fast inference of a trained U-Net for single frames on a CPU.

Every convolution is one matrix product. For a single frame of 13x5x5 points torch's convolutions
spend most of their time on re-ordering weights and padding. Here activations are rows (points,
features), the inputs of a kernel are gathered once, and the weights are stored in the order of the
product. Taps that never meet a point are left out. Where the CPU multiplies bfloat16, weights and
activations have that type: half as much memory is read, and a correction changes by some
micrometres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from palpate.correction.networks.architectures import CorrectionNetwork
from palpate.correction.networks.unet import PaddedConvolution, UNet
from palpate.foundation.arrays import IntArray

__all__ = ["UNetInference", "supports_bfloat16"]

Step = Callable[[Tensor], Tensor]
Shape = tuple[int, ...]


def supports_bfloat16() -> bool:
    """Return whether this CPU multiplies bfloat16 in hardware.

    On other CPUs bfloat16 is slower than single precision.
    """
    supported = getattr(torch.cpu, "_is_avx512_bf16_supported", None)
    return bool(supported is not None and supported())


class UNetInference:
    """Corrects single frames, as a `CorrectionNetwork` with a U-Net does with a batch of one.

    Args:
        network: a trained network over a grid.
        half: whether to compute in bfloat16 instead of the network's own type; None chooses it
            where the CPU supports it.
    """

    def __init__(self, network: CorrectionNetwork, half: bool | None = None) -> None:
        inside, grid = network.inside, network.grid
        if not isinstance(inside, UNet) or grid is None:
            raise TypeError(f"expected a U-Net, got a {type(inside).__name__}")
        self._type = (
            torch.bfloat16
            if (supports_bfloat16() if half is None else half)
            else network.bound.dtype
        )
        self._network, self._columns = network.cpu(), network.spec.columns
        shapes = [grid[::-1]]
        for _ in inside.down:
            shapes.append(tuple(-(-length // 2) for length in shapes[-1]))
        self._down = [
            self._block(block, shape) for block, shape in zip(inside.down, shapes[:-1], strict=True)
        ]
        self._pools = [_pool(shape) for shape in shapes[:-1]]
        self._bottom = self._block(inside.bottom, shapes[-1])
        coarse, fine = shapes[:0:-1], shapes[-2::-1]
        self._doubled = [
            self._double(part, a, b)
            for part, a, b in zip(inside.doubled, coarse, fine, strict=True)
        ]
        self._up = [self._block(block, shape) for block, shape in zip(inside.up, fine, strict=True)]
        self._last = self._linear(inside.last.weight.flatten(1), inside.last.bias)

    @torch.inference_mode()
    def __call__(self, vertices: Tensor, tool: Tensor) -> Tensor:
        """Return corrected vertices (v, 3) [m] of simulated ones and the tool (13,)."""
        net = self._network
        known = ((tool[self._columns] - net.tool_middle) / net.tool_scale).to(self._type)
        nodes = vertices[: len(net.rest)]
        values, skips = ((nodes - net.rest) / net.spread).to(self._type), []
        for block, pool in zip(self._down, self._pools, strict=True):
            values = block(values)
            skips.append(values)
            values = pool(values)
        values = self._bottom(torch.cat([values, known.expand(len(values), -1)], dim=1))
        for double, block in zip(self._doubled, self._up, strict=True):
            values = block(torch.cat([double(values), skips.pop()], dim=1))
        change = torch.tanh(self._last(values).to(vertices.dtype)) * net.bound
        return vertices + net.carry(change[None])[0]

    def _linear(self, weight: Tensor, bias: Tensor | None) -> Step:
        ready = weight.detach().to(self._type).contiguous()
        added = None if bias is None else bias.detach().to(self._type)
        return lambda values: functional.linear(values, ready, added)

    def _block(self, modules: torch.nn.Module, shape: Shape) -> Step:
        steps = [
            self._convolution(part, shape)
            for part in modules.children()
            if isinstance(part, PaddedConvolution)
        ]

        def block(values: Tensor) -> Tensor:
            for step in steps:
                values = torch.relu_(step(values))
            return values

        return block

    def _convolution(self, part: PaddedConvolution, shape: Shape) -> Step:
        rows, taps = _tap_rows(shape)
        axes = len(shape)
        # Kernels are stored along x, y, z; rows run with x fastest.
        weight = part.weight.permute(0, *range(axes + 1, 1, -1), 1).flatten(1, axes)[:, taps]
        product_ = self._linear(weight.flatten(1), part.bias)
        index, points, width = torch.from_numpy(rows.ravel()), rows.shape[0], rows.shape[1]

        def convolve(values: Tensor) -> Tensor:
            padded = functional.pad(values, (0, 0, 0, 1))
            return product_(padded.index_select(0, index).reshape(points, width * values.shape[1]))

        return convolve

    def _double(self, part: torch.nn.Module, coarse: Shape, fine: Shape) -> Step:
        """Return a transposed convolution with kernel and stride 2, cropped to the finer grid."""
        weight, bias = part.get_parameter("weight"), part.get_parameter("bias")
        axes, outputs = len(coarse), weight.shape[1]
        ordered = weight.permute(*range(axes + 1, 1, -1), 1, 0).reshape(-1, weight.shape[0])
        product_, added = self._linear(ordered, None), bias.detach().to(self._type)
        places = _places(fine)
        parent = np.ravel_multi_index(tuple(places.T // 2), coarse)
        corner = np.ravel_multi_index(tuple(places.T % 2), (2,) * axes)
        index = torch.from_numpy(parent * 2**axes + corner)
        return lambda values: product_(values).reshape(-1, outputs).index_select(0, index) + added


def _places(shape: Shape) -> IntArray:
    """Return the grid coordinates (p, axes) of all points, in the order of the rows."""
    return np.stack(np.unravel_index(np.arange(int(np.prod(shape))), shape), axis=1)


def _tap_rows(shape: Shape) -> tuple[IntArray, Sequence[int]]:
    """Return the rows (p, t) that each tap of a kernel of 3 meets at each point, and the taps.

    The row is the one after the last where a tap meets no point. Taps that never meet a point are
    left out.
    """
    places, count = _places(shape), int(np.prod(shape))
    columns, taps = [], []
    for number, shift in enumerate(product((-1, 0, 1), repeat=len(shape))):
        there = places + np.array(shift)
        inside = ((there >= 0) & (there < np.array(shape))).all(axis=1)
        if inside.any():
            clipped = np.clip(there, 0, np.array(shape) - 1)
            columns.append(np.where(inside, np.ravel_multi_index(tuple(clipped.T), shape), count))
            taps.append(number)
    return np.stack(columns, axis=1), taps


def _pool(shape: Shape) -> Step:
    """Return a max-pool of each two points along every axis; an odd last point is kept."""
    coarse = tuple(-(-length // 2) for length in shape)
    columns = [
        np.ravel_multi_index(
            tuple(np.minimum(2 * _places(coarse) + np.array(shift), np.array(shape) - 1).T), shape
        )
        for shift in product((0, 1), repeat=len(shape))
    ]
    index, points = torch.from_numpy(np.stack(columns, axis=1).ravel()), len(columns[0])
    return lambda values: (
        values.index_select(0, index).reshape(points, len(columns), -1).amax(dim=1)
    )
