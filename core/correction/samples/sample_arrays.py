"""Writer of the arrays of one sequence's samples, row by row through memory maps."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["ARRAYS", "SampleWriter"]

ARRAYS: dict[str, Any] = {
    "positions": np.float32,
    "tool": np.float32,
    "points": np.float32,
    "count": np.int32,
    "time": np.float64,
    "frame": np.int64,
    "probe": np.int64,
}
"""Names of the arrays and the types of their numbers; see
`palpate.correction.samples.sample_store`."""
_CHUNK = 256


class SampleWriter:
    """Writes the arrays of one sequence.

    Args:
        folder: an existing folder.
        rows: most rows; the arrays are cut to their number at the end.
        vertices: number of material points.
        points: most measured points of a frame.
    """

    def __init__(self, folder: Path, rows: int, vertices: int, points: int) -> None:
        shapes: dict[str, tuple[int, ...]] = {
            "positions": (vertices, 3),
            "tool": (13,),
            "points": (points, 3),
            "count": (2,),
        }
        self._folder, self._arrays = folder, {}
        for name, kind in ARRAYS.items():
            shape = (rows, *shapes.get(name, ()))
            self._arrays[name] = np.lib.format.open_memmap(
                folder / f"{name}.part.npy", "w+", kind, shape
            )

    def put(self, row: int, points: FloatArray, **values: Any) -> None:
        """Write a row: measured points (n, 3) [m], padded with NaN, and other arrays by name."""
        self._arrays["points"][row, : len(points)], self._arrays["points"][row, len(points) :] = (
            points,
            np.nan,
        )
        for name, value in values.items():
            self._arrays[name][row] = value

    def close(self, rows: int) -> None:
        """Write the first `rows` rows to the arrays' final files."""
        for name, array in self._arrays.items():
            whole = np.lib.format.open_memmap(
                self._folder / f"{name}.npy", "w+", array.dtype, (rows, *array.shape[1:])
            )
            for start in range(0, rows, _CHUNK):
                whole[start : start + _CHUNK] = array[start : min(start + _CHUNK, rows)]
            whole.flush()
            (self._folder / f"{name}.part.npy").unlink()
        self._arrays = {}
