"""The U-Net of Wu, Kazanzides and Unberath (2020), over two or three axes.

Each block has two convolutions and a max-pool. At the bottom the tool inputs are concatenated to
every voxel, and four convolutions reduce the features to those of the last block; transposed
convolutions with skip connections follow. Pools keep the last voxel of an odd length (`ceil_mode`),
and upsampled values are cropped to their skip connection: the output has the size of the input.

On a grid as small as 13x5x5 most of a convolution's kernel lies in the padding at the bottom: two
thirds of it along an axis of one voxel. `PaddedConvolution` leaves out the taps that never meet a
voxel, which changes no result and saves most of the work there. Measured: channels-last memory
makes training 5 % slower on a CPU.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["PaddedConvolution", "UNet", "max_pool", "max_pool_by_halves"]

KERNEL, BOTTOM = 3, 4
_TOOL = 0.1
"""Scale of the first weights of tool inputs, over that of all others [1]."""


class PaddedConvolution(nn.Module):
    """A convolution with kernel 3 and padding 1 over two or three axes."""

    def __init__(self, axes: int, inputs: int, outputs: int) -> None:
        super().__init__()
        made = (nn.Conv2d if axes == 2 else nn.Conv3d)(inputs, outputs, KERNEL, padding=1)
        self.weight, self._axes = made.weight, axes
        self.bias = nn.Parameter(torch.zeros(outputs))

    def forward(self, values: Tensor) -> Tensor:
        """Return (b, outputs, ...) of (b, inputs, ...)."""
        weight, padding = self.weight, [1] * self._axes
        for axis in range(self._axes):
            if values.shape[2 + axis] == 1:
                weight, padding[axis] = weight.narrow(2 + axis, 1, 1), 0
        convolve = functional.conv2d if self._axes == 2 else functional.conv3d
        return convolve(values, weight, self.bias, padding=padding)


def max_pool(values: Tensor) -> Tensor:
    """Return the maximum of each two voxels along every axis of (b, c, ...).

    The last voxel of an odd length is kept.
    """
    if values.device.type == "cpu":
        pool = functional.max_pool2d if values.dim() == 4 else functional.max_pool3d
        return torch.as_tensor(pool(values, 2, ceil_mode=True))
    return max_pool_by_halves(values)


def max_pool_by_halves(values: Tensor) -> Tensor:
    """Return the same as `max_pool`, with a gradient that is deterministic on CUDA.

    Three times slower on a CPU.
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
    """A U-Net that maps values on a grid, and global inputs, to values on the same grid.

    Args:
        grid: points along two or three axes, for which the first weights are scaled; other grids
            are accepted as well.
        channels: number of channels of input and output.
        known: number of global inputs, which are concatenated at the bottom.
        features: features of the blocks from fine to coarse.
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
        """Initialise weights so that the variance is preserved (He et al. 2015).

        Only the taps that meet a voxel are counted. With torch's own initialisation the tool inputs
        at the bottom reach the output attenuated by 1e-8.
        """
        lengths = [list(grid)]
        for _ in self.down:
            lengths.append([-(-length // 2) for length in lengths[-1]])
        parts = [*self.down, self.bottom, *self.up]
        shapes = [*lengths[:-1], lengths[-1], *lengths[-2::-1]]
        for part, shape in zip(parts, shapes, strict=True):
            met = math.prod((3 * length - 2) / length for length in shape)
            for layer in part.modules():
                if isinstance(layer, PaddedConvolution):
                    layer.weight.normal_(0.0, math.sqrt(2.0 / (met * layer.weight.shape[1])))
                    layer.bias.zero_()
        # After training on few tool positions a network that depends strongly on the tool inputs
        # extrapolates badly; their first weights are therefore small.
        first = self.bottom[0].get_parameter("weight")
        first[:, first.shape[1] - self._known :] *= _TOOL
        for layer in self.doubled:
            weight = layer.get_parameter("weight")
            weight.normal_(0.0, math.sqrt(1.0 / weight.shape[0]))
            layer.get_parameter("bias").zero_()

    def forward(self, values: Tensor, known: Tensor) -> Tensor:
        """Return (b, channels, nx, ny[, nz]) of values of this shape and global inputs (b, k)."""
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
