"""The U-Net of Wu, Kazanzides and Unberath (2020), for two or three axes by one implementation.

Blocks of two convolutions and a max-pool each; at the bottom the tool is concatenated to every
voxel and four more convolutions bring the features back to those of the last block; then up again
with skip connections. Pools keep what an odd size leaves over (`ceil_mode`), and what was doubled
is cut to the size of its skip connection: the output has the input's size whatever it is.

At the bottom of a grid as small as 13x5x5 most of a convolution's kernel lies in the padding: along
an axis of one voxel two thirds of it. `PaddedConvolution` leaves the taps out that never meet a voxel, which
changes no result and saves most of the work there. Channels-last memory was tried: on a processor
training is 5 % slower with it (`python -m benchmarks correction`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["PaddedConvolution", "UNet", "max_pool_by_halves", "max_pool"]

KERNEL, BOTTOM = 3, 4
_TOOL = 0.1
"""Size of the first weights on what is known of the tool, over that of all others [1]."""


class PaddedConvolution(nn.Module):
    """A convolution with kernel 3 and padding 1 over two or three axes."""

    def __init__(self, axes: int, inputs: int, outputs: int) -> None:
        super().__init__()
        made = (nn.Conv2d if axes == 2 else nn.Conv3d)(inputs, outputs, KERNEL, padding=1)
        self.weight, self._axes = made.weight, axes
        self.bias = nn.Parameter(torch.zeros(outputs))

    def forward(self, values: Tensor) -> Tensor:
        """(b, outputs, ...) of (b, inputs, ...)."""
        weight, padding = self.weight, [1] * self._axes
        for axis in range(self._axes):
            if values.shape[2 + axis] == 1:
                weight, padding[axis] = weight.narrow(2 + axis, 1, 1), 0
        convolve = functional.conv2d if self._axes == 2 else functional.conv3d
        return convolve(values, weight, self.bias, padding=padding)


def max_pool(values: Tensor) -> Tensor:
    """The largest of each two along every axis (b, c, ...), and what an odd length leaves over."""
    if values.device.type == "cpu":
        pool = functional.max_pool2d if values.dim() == 4 else functional.max_pool3d
        return torch.as_tensor(pool(values, 2, ceil_mode=True))
    return max_pool_by_halves(values)


def max_pool_by_halves(values: Tensor) -> Tensor:
    """The same by steps whose gradients CUDA adds up in one order, as it does not those of its own
    pools; 3 times slower on CPU.
    """
    for axis in range(2, values.dim()):
        length = values.shape[axis]
        pairs = (
            values.narrow(axis, 0, length // 2 * 2).unflatten(axis, (length // 2, 2)).amax(axis + 1)
        )
        values = (
            torch.cat([pairs, values.narrow(axis, length - 1, 1)], dim=axis)
            if length % 2
            else pairs
        )
    return values


def _two(axes: int, inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(
        PaddedConvolution(axes, inputs, outputs),
        nn.ReLU(),
        PaddedConvolution(axes, outputs, outputs),
        nn.ReLU(),
    )


class UNet(nn.Module):
    """Values on a grid, and numbers that hold for all of it, to values on the same grid.

    Args:
        grid: points along two or three axes that its first weights are made for; it takes any
            other, too.
        channels: in and out.
        known: numbers concatenated at the bottom.
        features: of the blocks, from fine to coarse.
    """

    def __init__(
        self,
        grid: Sequence[int],
        channels: int,
        known: int,
        features: Sequence[int] = (64, 128, 256),
    ) -> None:
        super().__init__()
        self._axes, self._known = len(grid), known
        axes = self._axes
        ahead = [channels, *features[:-1]]
        self.down = nn.ModuleList(_two(axes, a, b) for a, b in zip(ahead, features, strict=True))
        deep = features[-1]
        bottom: list[nn.Module] = []
        for number in range(BOTTOM):
            bottom += [
                PaddedConvolution(axes, deep + known if number == 0 else deep, deep),
                nn.ReLU(),
            ]
        self.bottom = nn.Sequential(*bottom)
        widths, transposed = (
            [deep, *reversed(features)],
            nn.ConvTranspose2d if axes == 2 else nn.ConvTranspose3d,
        )
        self.doubled = nn.ModuleList(transposed(a, b, 2, stride=2) for a, b in pairwise(widths))
        self.up = nn.ModuleList(_two(axes, 2 * width, width) for width in reversed(features))
        self.last = (nn.Conv2d if axes == 2 else nn.Conv3d)(features[0], channels, 1)
        self._draw(grid)

    @torch.no_grad()
    def _draw(self, grid: Sequence[int]) -> None:
        """First weights that keep the size of what goes through (He et al. 2015), counting only the
        taps that meet a voxel.

        With torch's own, what the tool says at the bottom arrives at the output as 1e-8 of what it
        was.
        """
        lengths = [list(grid)]
        for _ in self.down:
            lengths.append([-(-length // 2) for length in lengths[-1]])
        parts = [*self.down, self.bottom, *self.up]
        for part, shape in zip(parts, [*lengths[:-1], lengths[-1], *lengths[-2::-1]], strict=True):
            met = math.prod((3 * length - 2) / length for length in shape)
            for layer in part.modules():
                if isinstance(layer, PaddedConvolution):
                    layer.weight.normal_(0.0, math.sqrt(2.0 / (met * layer.weight.shape[1])))
                    layer.bias.zero_()
        # TrainedNetwork on few places, a network that heeds the tool from the start says anything of all
        # others.
        first = self.bottom[0].get_parameter("weight")
        first[:, first.shape[1] - self._known :] *= _TOOL
        for layer in self.doubled:
            weight = layer.get_parameter("weight")
            weight.normal_(0.0, math.sqrt(1.0 / weight.shape[0]))
            layer.get_parameter("bias").zero_()

    def forward(self, values: Tensor, known: Tensor) -> Tensor:
        """(b, channels, nx, ny[, nz]) of the same shape and what is known (b, k)."""
        values = values.contiguous()
        skips = []
        for block in self.down:
            values = block(values)
            skips.append(values)
            values = max_pool(values)
        spread = known.reshape(*known.shape, *[1] * self._axes).expand(-1, -1, *values.shape[2:])
        values = self.bottom(torch.cat([values, spread.to(values.dtype)], dim=1))
        for double, block in zip(self.doubled, self.up, strict=True):
            skip = skips.pop()
            values = double(values)
            for axis, length in enumerate(skip.shape[2:]):
                values = values.narrow(2 + axis, 0, length)
            values = block(torch.cat([values, skip], dim=1))
        return torch.as_tensor(self.last(values))
