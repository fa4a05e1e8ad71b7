"""Recordings: sources that were recorded together, and their streams read into tracks."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import Report, silent
from palpate.importing.clocks.track import Track
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.opened_sources import open_source
from palpate.importing.sources.table_source import TableSource
from palpate.importing.stream import Sample, Source, Stream, StreamKind
from palpate.importing.tables.table_preview import TablePreview

__all__ = ["Recording", "opened_recording"]

_BLOCK = 8192
"""Samples that are kept as Python objects before they become an array."""


@dataclass(frozen=True, eq=False)
class Recording:
    """Sources that were recorded together.

    Attributes:
        name: of the recording.
        sources: of its data.
    """

    name: str
    sources: tuple[Source, ...]

    def streams(self) -> tuple[Stream, ...]:
        """List the streams of all sources."""
        return tuple(stream for source in self.sources for stream in source.streams())

    def named(self, name: str, kind: StreamKind) -> str:
        """Name of this stream here: the same, or that of the only one of its kind.

        Streams of files are named after them, and so differently in each recording; a topic has
        the same name in all.
        """
        if not name or name.startswith("/"):
            return name
        streams = self.streams()
        own = [one.name for one in streams if one.kind == kind]
        known = any(one.name == name for one in streams)
        return name if known or len(own) != 1 else own[0]

    def samples(self, name: str) -> Iterator[Sample]:
        """Read the samples of one stream in order of receipt."""
        for source in self.sources:
            if any(one.name == name for one in source.streams()):
                yield from source.samples({name})

    def tracks(self, names: dict[str, bool], report: Report = silent) -> dict[str, Track]:
        """Read streams into arrays, one pass over each source.

        Args:
            names: of the streams, and whether their values are read; stamps are in any case.
            report: of the progress.
        """
        total = sum(one.count for one in self.streams() if one.name in names) or 1
        done = 0
        growing = {name: _Growing() for name in names}
        receipt = dict.fromkeys(names, True)
        for source in self.sources:
            known = {one.name for one in source.streams()} & set(names)
            receipt.update(dict.fromkeys(known, source.has_receipt))
            for sample in source.samples(known) if known else ():
                growing[sample.stream].add(sample, names[sample.stream])
                done += 1
                if done % _BLOCK == 0:
                    report(min(1.0, done / total), f"{self.name}: {done} samples read")
        report(1.0, f"{self.name}: {done} samples read")
        return {name: one.track(name, receipt[name]) for name, one in growing.items() if one.count}

    def files(self) -> tuple[Path, ...]:
        """List the files of all sources."""
        return tuple(dict.fromkeys(file for source in self.sources for file in source.files()))

    def warnings(self) -> list[str]:
        """List the warnings of all sources."""
        return [warning for source in self.sources for warning in source.warnings]

    def previews(self, rows: int = 3) -> tuple[TablePreview, ...]:
        """First rows of its tables as they are understood."""
        tables = (one for one in self.sources if isinstance(one, TableSource))
        return tuple(found for one in tables if (found := one.preview(rows)) is not None)

    def sure_seconds(self, without: Source) -> tuple[float, ...]:
        """Durations [s] of the streams of other sources, but for tables with a doubtful unit."""
        return tuple(
            stream.seconds
            for source in self.sources
            if source is not without
            and not (isinstance(source, TableSource) and "time_unit" in source.doubts)
            for stream in source.streams()
            if stream.count > 1 and stream.seconds > 0
        )

    def close(self) -> None:
        """Close all sources."""
        for source in self.sources:
            source.close()


def opened_recording(
    name: str, paths: tuple[Path, ...], tables: dict[str, ColumnRules]
) -> Recording:
    """Open the files of one recording; DatasetError where one cannot be read."""
    opened: list[Source] = []
    try:
        for path in paths:
            opened.append(open_source(path, tables.get(path.name)))
    except DatasetError:
        for source in opened:
            source.close()
        raise
    return Recording(name, tuple(opened))


@dataclass
class _Growing:
    """Samples of one stream, blocks of which become arrays."""

    count: int = 0
    numbers: list[tuple[int, int]] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)
    frames: dict[str, None] = field(default_factory=dict)
    done: list[tuple[Any, Any]] = field(default_factory=list)

    def add(self, sample: Sample, with_value: bool) -> None:
        self.count += 1
        self.numbers.append((sample.received, sample.stamped))
        if with_value:
            self.values.append(sample.value())
        self.frames.setdefault(sample.frame)
        if len(self.numbers) >= _BLOCK:
            self._flush()

    def _flush(self) -> None:
        stamps = np.array(self.numbers, dtype=np.int64).reshape(-1, 2)
        values = np.array(self.values, dtype=float) if self.values else np.empty((len(stamps), 0))
        self.done.append((stamps, values))
        self.numbers, self.values = [], []

    def track(self, name: str, has_receipt: bool) -> Track:
        self._flush()
        stamps = np.concatenate([one for one, _ in self.done])
        values = np.concatenate([one for _, one in self.done if one.size] or [np.empty((0, 0))])
        return Track(
            stream=name,
            received=stamps[:, 0],
            stamped=stamps[:, 1],
            values=values if len(values) else np.empty((len(stamps), 0)),
            frames=tuple(self.frames),
            has_receipt=has_receipt,
        )
