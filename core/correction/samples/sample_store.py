"""Training samples on disk: what was simulated, where the tool was and what was measured, frame by frame, never loaded whole.

samples/
  samples.json              where they come from, splits, and what is in each column
  body.npz                  the material points, see `palpate.correction.samples.corrected_points`
  <sequence>/positions.npy  (n, v, 3) simulated places of the points [m]
             tool.npy       (n, 13) tool: position [m], quaternion, velocity [m/s], force [N]; all in the phantom frame
             points.npy     (n, p, 3) measured points [m], those of the top first; NaN beyond their number
             count.npy      (n, 2) points of the top, and all
             time.npy       (n,) cloud stamp [s]
             frame.npy      (n,) number of the cloud
             probe.npy      (n,) which push, counted from 1; 0 where the tool is clear of the block
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

__all__ = ["FORMAT", "Batch", "Samples", "open_samples"]

FORMAT = 1


@dataclass(frozen=True, eq=False)
class Batch:
    """Samples that are worked on together: positions (b, v, 3), tool (b, 13), points (b, p, 3),
    count (b, 2); see the module.
    """

    positions: Tensor
    tool: Tensor
    points: Tensor
    count: Tensor

    def __len__(self) -> int:
        return len(self.positions)

    def to(self, device: torch.device) -> Batch:
        """On this device."""
        parts = (self.positions, self.tool, self.points, self.count)
        return Batch(*(part.to(device, non_blocking=True) for part in parts))

    def joined(self, other: Batch) -> Batch:
        """Both, this one first."""
        pairs = zip(vars(self).values(), vars(other).values(), strict=True)
        return Batch(*(torch.cat(pair) for pair in pairs))


@dataclass(frozen=True, eq=False)
class Samples:
    """A folder of samples; a row is (sequence, frame), counted over all sequences in the order of
    `sequences`.

    Attributes:
        folder: where they are.
        about: what samples.json says.
        body: the material points.
    """

    folder: Path
    about: dict[str, Any]
    body: Body

    @property
    def sequences(self) -> tuple[str, ...]:
        """Names."""
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
        """(v,) measured points per frame near each material point; zero where the camera never
        looks.
        """
        return np.asarray(self.about["seen"], dtype=float)

    def array(self, sequence: str, name: str) -> Any:
        """One of ARRAYS of one sequence, mapped from disk."""
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
        """Rows (n,) of these sequences, in their order; CorrectionError that names one that is not
        here.
        """
        found = [np.empty(0, dtype=np.int64)]
        for name in sequences:
            if name not in self.sequences:
                raise CorrectionError(
                    f"no samples of {name!r}; there are {', '.join(self.sequences)}",
                    key="sequences",
                    value=name,
                )
            number = self.sequences.index(name)
            found.append(np.arange(self._starts[number], self._starts[number + 1]))
        return np.concatenate(found)

    def column(self, name: str, rows: IntArray) -> Any:
        """Of these rows one of ARRAYS (n, ...), read from disk."""
        arrays = self._mapped[name]
        which = np.searchsorted(self._starts, rows, side="right") - 1
        found = np.empty((len(rows), *arrays[0].shape[1:]), dtype=arrays[0].dtype)
        for number in np.unique(which):
            here = which == number
            found[here] = arrays[number][rows[here] - self._starts[number]]
        return found

    def batch(self, rows: IntArray) -> Batch:
        """These rows, read from disk."""
        return Batch(
            *(
                torch.from_numpy(self.column(name, rows))
                for name in ("positions", "tool", "points", "count")
            )
        )

    def batches(self, rows: IntArray, size: int) -> Iterator[Batch]:
        """The rows in their order, `size` at a time."""
        for start in range(0, len(rows), size):
            yield self.batch(rows[start : start + size])


def open_samples(folder: Path) -> Samples:
    """Samples that were made whole; RunError for anything else."""
    try:
        about = json.loads((folder / "samples.json").read_text())
        with np.load(folder / "body.npz") as arrays:
            body = Body.from_arrays({**arrays, "grid": about["grid"], "flat": False})
    except (OSError, ValueError, KeyError) as error:
        raise RunError(
            f"{folder} holds no samples ({error}); make them first", path=str(folder)
        ) from None
    if about.get("format") != FORMAT:
        raise RunError(
            f"{folder} has samples of format {about.get('format')}; expected {FORMAT}: make them again",
            path=str(folder),
        )
    return Samples(folder, about, body)
