"""Streams of stamped samples: the protocol of everything that holds recorded data."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from palpate.foundation.arrays import FloatArray
from palpate.importing.rules import ColumnRules

__all__ = ["Sample", "Source", "Stream", "StreamKind"]

StreamKind = Literal["pose", "cloud", "depth", "wrench", "camera", "joints", "other"]


@dataclass(frozen=True, kw_only=True)
class Stream:
    """One stream of a recording.

    Attributes:
        name: topic, or file; a frame of tf stands behind a "#".
        kind: by the message's type: "pose" of a tool, "cloud" of points, "depth" image, "wrench",
            "camera" (its intrinsics), "joints", or "other".
        message_type: name of the type, or of the file's format.
        count: number of samples.
        seconds: from the first to the last sample, by receipt [s].
        frames: frame ids of the first samples.
        delay: from the first header stamp to its receipt [s]; None without both.
    """

    name: str
    kind: StreamKind
    message_type: str
    count: int
    seconds: float
    frames: tuple[str, ...] = ()
    delay: float | None = None

    @property
    def rate(self) -> float:
        """Samples per second [Hz]; 0 for fewer than two."""
        return (self.count - 1) / self.seconds if self.seconds > 0 and self.count > 1 else 0.0


@dataclass(frozen=True, kw_only=True, slots=True)
class Sample:
    """One stamped sample.

    Attributes:
        stream: name of its stream.
        received: time of receipt, or of the row [ns].
        stamped: time in its header [ns]; 0 without.
        frame: frame id in its header; empty without.
        value: decodes it: a pose (7,) x, y, z [m], qx, qy, qz, qw; a wrench (6,) [N, N m]; a
            cloud (..., 3) [m]; a depth image (rows, columns) [m]; NaN where nothing was measured;
            intrinsics (11 and more,): rows, columns, matrix (9,), distortion.
    """

    stream: str
    received: int
    stamped: int
    frame: str
    value: Callable[[], FloatArray]


class Source(Protocol):
    """One file or folder of recorded data.

    Attributes:
        path: of the file or folder.
        has_receipt: whether times of receipt are a clock of their own.
        rules: meaning of its columns, of a table; None otherwise.
    """

    path: Path
    has_receipt: bool
    rules: ColumnRules | None

    @property
    def warnings(self) -> list[str]:
        """List what was found on opening and reading."""
        ...

    def streams(self) -> tuple[Stream, ...]:
        """List the streams."""
        ...

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the samples of these streams one by one, in order of receipt."""
        ...

    def files(self) -> tuple[Path, ...]:
        """List the files that hold the data, for their digests."""
        ...

    def close(self) -> None:
        """Close the files."""
        ...
