"""The U-Net of Wu, Kazanzides and Unberath (2020), for two or three axes by one implementation.

Blocks of two convolutions and a max-pool each; at the bottom the tool is concatenated to every voxel and four more convolutions
bring the features back to those of the last block; then up again with skip connections. Pools keep what an odd size leaves over
(`ceil_mode`), and what was doubled is cut to the size of its skip connection: the output has the input's size whatever it is.

At the bottom of a grid as small as 13x5x5 most of a convolution's kernel lies in the padding: along an axis of one voxel two thirds
of it. `Padded` leaves the taps out that never meet a voxel, which changes no result and saves most of the work there.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["Padded", "UNet"]

KERNEL, BOTTOM = 3, 4


class Padded(nn.Module):
    """A convolution with kernel 3 and padding 1 over two or three axes."""

    def __init__(self, axes: int, inputs: int, outputs: int) -> None:
        super().__init__()
        made = (nn.Conv2d if axes == 2 else nn.Conv3d)(inputs, outputs, KERNEL, padding=1)
        self.weight, self.bias, self._axes = made.weight, made.bias, axes

    def forward(self, values: Tensor) -> Tensor:
        """(b, outputs, ...) of (b, inputs, ...)."""
        weight, padding = self.weight, [1] * self._axes
        for axis in range(self._axes):
            if values.shape[2 + axis] == 1:
                weight, padding[axis] = weight.narrow(2 + axis, 1, 1), 0
        convolve = functional.conv2d if self._axes == 2 else functional.conv3d
        return convolve(values, weight, self.bias, padding=padding)


def _two(axes: int, inputs: int, outputs: int) -> nn.Sequential:
    return nn.Sequential(Padded(axes, inputs, outputs), nn.ReLU(), Padded(axes, outputs, outputs), nn.ReLU())


class UNet(nn.Module):
    """Values on a grid, and numbers that hold for all of it, to values on the same grid.

    Args:
        axes: 2 or 3. channels: in and out. known: numbers concatenated at the bottom. features: of the blocks, from fine to coarse.
    """

    def __init__(self, axes: int, channels: int, known: int, features: Sequence[int] = (64, 128, 256)) -> None:
        super().__init__()
        self._axes = axes
        ahead = [channels, *features[:-1]]
        self.down = nn.ModuleList(_two(axes, a, b) for a, b in zip(ahead, features, strict=True))
        deep = features[-1]
        bottom: list[nn.Module] = []
        for number in range(BOTTOM):
            bottom += [Padded(axes, deep + known if number == 0 else deep, deep), nn.ReLU()]
        self.bottom = nn.Sequential(*bottom)
        widths, transposed = [deep, *reversed(features)], nn.ConvTranspose2d if axes == 2 else nn.ConvTranspose3d
        self.doubled = nn.ModuleList(transposed(a, b, 2, stride=2) for a, b in pairwise(widths))
        self.up = nn.ModuleList(_two(axes, 2 * width, width) for width in reversed(features))
        self.last = (nn.Conv2d if axes == 2 else nn.Conv3d)(features[0], channels, 1)

    def forward(self, values: Tensor, known: Tensor) -> Tensor:
        """(b, channels, nx, ny[, nz]) of the same shape and what is known (b, k)."""
        pool = functional.max_pool2d if self._axes == 2 else functional.max_pool3d
        values = values.contiguous(memory_format=torch.channels_last if self._axes == 2 else torch.channels_last_3d)
        skips = []
        for block in self.down:
            values = block(values)
            skips.append(values)
            values = pool(values, 2, ceil_mode=True)
        spread = known.reshape(*known.shape, *[1] * self._axes).expand(-1, -1, *values.shape[2:])
        values = self.bottom(torch.cat([values, spread.to(values.dtype)], dim=1))
        for double, block in zip(self.doubled, self.up, strict=True):
            skip = skips.pop()
            values = double(values)
            for axis, length in enumerate(skip.shape[2:]):
                values = values.narrow(2 + axis, 0, length)
            values = block(torch.cat([values, skip], dim=1))
        return torch.as_tensor(self.last(values))
