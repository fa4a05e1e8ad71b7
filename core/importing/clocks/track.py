"""One stream of a recording as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray

__all__ = ["Stamps", "Track"]

Stamps = np.ndarray[Any, np.dtype[np.int64]]


@dataclass(frozen=True, eq=False, kw_only=True)
class Track:
    """All samples of one stream.

    Attributes:
        stream: its name.
        received: (n,) times of receipt [ns]; of a table those of its rows.
        stamped: (n,) header stamps [ns], 0 without.
        values: (n, k) numbers of its samples; (n, 0) of clouds, which are read later.
        frames: frame ids that occur, in order of first use.
        has_receipt: whether `received` is a clock of its own.
    """

    stream: str
    received: Stamps
    stamped: Stamps
    values: FloatArray
    frames: tuple[str, ...]
    has_receipt: bool = True

    def __len__(self) -> int:
        return len(self.received)
