"""Training samples on disk, read frame by frame: simulated shape, tool, and measured points.

samples/
  samples.json       origin of the samples, splits, and numbers of samples
  body.npz           the material points, see `palpate.correction.samples.corrected_points`
  chart.npz          those over the top, of a body with a grid
  <sequence>/
    positions.npy    (n, r, 3) simulated positions of the points of both [m]
    tool.npy         (n, 13) tool: position [m], quaternion, velocity [m/s], force [N]
    points.npy       (n, p, 3) measured points [m], those seen from above first; NaN beyond
                     their number
    count.npy        (n, 2) number of points seen from above, and of all points
    time.npy         (n,) cloud stamp [s]
    frame.npy        (n,) number of the cloud
    probe.npy        (n,) number of the push, from 1; 0 where the tool is clear of the block

All coordinates are in the phantom frame.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from palpate.correction.samples.corrected_points import Body
from palpate.correction.samples.sample_arrays import ARRAYS
from palpate.foundation.arrays import FloatArray, IntArray
from palpate.foundation.errors import CorrectionError, RunError
from palpate.setup.box import Box

__all__ = ["FORMAT", "Batch", "Samples", "body_for", "open_samples", "save_bodies"]

FORMAT, BODY, CHART = 2, "body.npz", "chart.npz"
BLOCKS_ONLY = 1
"""Format without chart.npz and with the grid in samples.json; the body with a grid is a block."""


@dataclass(frozen=True, eq=False)
class Batch:
    """A batch of samples, see the module.

    Attributes:
        positions: (b, r, 3) simulated positions [m].
        tool: (b, 13) tool.
        points: (b, p, 3) measured points [m].
        count: (b, 2) numbers of points.
    """

    positions: Tensor
    tool: Tensor
    points: Tensor
    count: Tensor

    def __len__(self) -> int:
        return len(self.positions)

    def to(self, device: torch.device) -> Batch:
        """Return the batch on a device."""
        parts = (self.positions, self.tool, self.points, self.count)
        return Batch(*(part.to(device, non_blocking=True) for part in parts))

    def joined(self, other: Batch) -> Batch:
        """Return both batches as one, this one first."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Batch(*(torch.cat(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class Samples:
    """A folder of samples; rows are numbered over all sequences, in the order of `sequences`.

    Attributes:
        folder: the folder.
        about: content of samples.json.
        body: the material points.
        chart: those over the top; None for a body without a grid.
    """

    folder: Path
    about: dict[str, Any]
    body: Body
    chart: Body | None = None

    @property
    def sequences(self) -> tuple[str, ...]:
        """Names of the sequences."""
        return tuple(self.about["sequences"])

    @cached_property
    def _starts(self) -> IntArray:
        return np.concatenate(
            [[0], np.cumsum([self.about["sequences"][name] for name in self.sequences])]
        )

    def __len__(self) -> int:
        return int(self._starts[-1])

    @cached_property
    def seen(self) -> FloatArray:
        """Mean number of measured points per frame near each material point (r,).

        Zero where the camera never sees the surface.
        """
        return np.asarray(self.about["seen"], dtype=float)

    def array(self, sequence: str, name: str) -> Any:
        """Return one of ARRAYS of a sequence, memory-mapped; RunError where it cannot be read."""
        path = self.folder / sequence / f"{name}.npy"
        try:
            return np.load(path, mmap_mode="r")
        except (OSError, EOFError, ValueError) as error:
            raise RunError(
                f"{path} cannot be read ({error}); make the samples again", file=str(path)
            ) from None

    @cached_property
    def _mapped(self) -> dict[str, list[Any]]:
        return {
            name: [self.array(sequence, name) for sequence in self.sequences] for name in ARRAYS
        }

    def rows(self, sequences: Sequence[str]) -> IntArray:
        """Return the rows (n,) of sequences, in their order.

        Raises CorrectionError for a sequence without samples.
        """
        rows = [np.empty(0, dtype=np.int64)]
        for name in sequences:
            if name not in self.sequences:
                raise CorrectionError(
                    f"no samples of {name!r}; there are {', '.join(self.sequences)}",
                    key="sequences",
                    value=name,
                )
            number = self.sequences.index(name)
            rows.append(np.arange(self._starts[number], self._starts[number + 1]))
        return np.concatenate(rows)

    def column(self, name: str, rows: IntArray) -> Any:
        """Read one of ARRAYS for these rows (n, ...)."""
        arrays = self._mapped[name]
        which = np.searchsorted(self._starts, rows, side="right") - 1
        values = np.empty((len(rows), *arrays[0].shape[1:]), dtype=arrays[0].dtype)
        for number in np.unique(which):
            here = which == number
            values[here] = arrays[number][rows[here] - self._starts[number]]
        return values

    def batch(self, rows: IntArray) -> Batch:
        """Read these rows."""
        return Batch(
            *(
                torch.from_numpy(self.column(name, rows))
                for name in ("positions", "tool", "points", "count")
            )
        )

    def batches(self, rows: IntArray, size: int) -> Iterator[Batch]:
        """Yield batches of `size` rows, in order."""
        for start in range(0, len(rows), size):
            yield self.batch(rows[start : start + size])


def open_samples(folder: Path) -> Samples:
    """Open complete samples; RunError for anything else."""
    try:
        about = json.loads((folder / "samples.json").read_text())
        body, chart = _read_bodies(folder, about)
    except (OSError, ValueError, KeyError) as error:
        raise RunError(
            f"{folder} holds no samples ({error}); make them first", path=str(folder)
        ) from None
    if about.get("format") not in (BLOCKS_ONLY, FORMAT):
        raise RunError(
            f"{folder} has samples of format {about.get('format')}; expected {FORMAT}: "
            "make them again",
            path=str(folder),
        )
    return Samples(folder, about, body, chart)


def body_for(samples: Samples, kind: str) -> Body:
    """Return the points that a network of this kind corrects.

    Raises CorrectionError for a network over the top of a body without a grid.
    """
    if kind != "unet2d":
        return samples.body
    if samples.chart is None:
        raise CorrectionError(
            "only a body with a grid has a grid over its top; take kind graph for other meshes",
            key="kind",
        )
    return samples.chart


def save_bodies(folder: Path, body: Body, chart: Body | None) -> None:
    """Write the material points of samples, and those over the top if there are any."""
    for name, one in ((BODY, body), (CHART, chart)):
        if one is not None:
            arrays = one.to_arrays()
            np.savez(folder / name, **{**arrays, "grid": np.array(arrays["grid"] or [], dtype=int)})


def _read_bodies(folder: Path, about: dict[str, Any]) -> tuple[Body, Body | None]:
    """Return the material points and those over the top."""
    if about.get("format") != BLOCKS_ONLY:
        chart = _read_body(folder / CHART) if (folder / CHART).is_file() else None
        return _read_body(folder / BODY), chart
    with np.load(folder / BODY) as arrays:
        body = Body.from_arrays({**arrays, "grid": about["grid"], "flat": False})
    if body.grid is None:
        return body, None
    x, y, z = about["setup"]["geometry"]["size"]
    return body, body.over(Box(size=(x, y, z)))


def _read_body(path: Path) -> Body:
    with np.load(path) as arrays:
        grid = arrays["grid"].tolist()
        return Body.from_arrays({**arrays, "grid": grid or None})
