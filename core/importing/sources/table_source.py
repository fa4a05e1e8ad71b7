"""Tables of poses, forces and clouds, by a mapping of their columns."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError
from palpate.importing.rules import ColumnRules
from palpate.importing.sources.cloud_file import CLOUD_SUFFIXES, read_cloud_file
from palpate.importing.stream import Sample, Stream, StreamKind
from palpate.importing.tables.matlab_table import read_matlab
from palpate.importing.tables.table_columns import proposed_columns
from palpate.importing.tables.table_preview import TablePreview, preview_of
from palpate.importing.tables.table_rotation import row_quaternions
from palpate.importing.tables.table_text import TextTable, read_table
from palpate.importing.tables.table_units import METRES, NEWTONS, received_stamps, row_stamps

__all__ = ["TableSource"]

_FORCE = ("fx", "fy", "fz")


class TableSource:
    """One table; its streams are named after the file and what they hold.

    Attributes:
        path: of the file.
        rules: meaning of its columns; None where nothing is recognised.
        stated: quantities whose unit stands in the name of their column.
        doubts: sentences on what was taken by size only, by key of `rules`.
        has_receipt: whether times of receipt are a column of their own.
    """

    def __init__(self, path: Path, rules: ColumnRules | None = None) -> None:
        self.path = path
        self.stated: frozenset[str] = frozenset()
        self.doubts: dict[str, str] = {}
        self.table: TextTable = read_matlab(path) if path.suffix == ".mat" else read_table(path)
        self.rules = rules
        if rules is None:
            proposed = proposed_columns(self.table)
            self.rules, self.stated = proposed.rules, proposed.stated
            self.doubts = dict(proposed.doubts)
        known = self.rules.columns if self.rules is not None else {}
        self.has_receipt = "t" in known and "received" in known

    @property
    def warnings(self) -> list[str]:
        """List the doubts about its columns."""
        return list(self.doubts.values())

    @staticmethod
    def fits(path: Path) -> bool:
        """Whether a path is such a file, by its name."""
        return path.is_file() and path.suffix.lower() in (".csv", ".tsv", ".txt", ".mat", ".dat")

    def files(self) -> tuple[Path, ...]:
        """List the table, and the clouds that it names."""
        if self.rules is None or "file" not in self.rules.columns:
            return (self.path,)
        return (self.path, *(self._cloud(name) for name in self._column("file")))

    def close(self) -> None:
        """Do nothing: the table was read at once."""

    def streams(self) -> tuple[Stream, ...]:
        """List what the columns hold: a pose, forces, clouds; or the unknown columns."""
        kinds = self._kinds()
        if not kinds:
            columns = ", ".join(self.table.columns)
            return (
                Stream(
                    name=self.path.name,
                    kind="other",
                    message_type=f"table of {columns[:80]}",
                    count=len(self.table),
                    seconds=0.0,
                ),
            )
        times = self._times()
        return tuple(
            Stream(
                name=f"{self.path.name}#{kind}",
                kind=kind,
                message_type="table",
                count=len(times),
                seconds=(times[-1] - times[0]) / 1e9,
            )
            for kind in kinds
        )

    def samples(self, names: Collection[str]) -> Iterator[Sample]:
        """Read the rows in their order."""
        kinds = [kind for kind in self._kinds() if f"{self.path.name}#{kind}" in names]
        times = self._times() if kinds else []
        received = times
        if self.has_receipt and self.rules is not None:
            received = received_stamps(self.table, self.rules)
        readers = {kind: self._reader(kind) for kind in kinds}
        for row, time in enumerate(times):
            for kind in kinds:
                yield Sample(
                    stream=f"{self.path.name}#{kind}",
                    received=received[row],
                    stamped=time,
                    frame="",
                    value=partial(readers[kind], row),
                )

    def preview(self, rows: int = 3) -> TablePreview | None:
        """The first rows as they are understood; None where no column is."""
        if self.rules is None:
            return None
        return preview_of(self.table, self.rules, self.doubts.values(), rows)

    def _kinds(self) -> list[StreamKind]:
        if self.rules is None:
            return []
        known = self.rules.columns
        kinds: list[StreamKind] = []
        if all(axis in known for axis in "xyz"):
            kinds.append("pose")
        if all(axis in known for axis in _FORCE):
            kinds.append("wrench")
        if "file" in known:
            kinds.append("cloud")
        return kinds

    def _column(self, quantity: str) -> list[str]:
        assert self.rules is not None
        return self.table.texts(self.rules.columns[quantity])

    def _numbers(self, quantity: str) -> FloatArray:
        assert self.rules is not None
        return self.table.numbers(self.rules.columns[quantity])

    def _times(self) -> list[int]:
        """Stamps of the rows [ns]; whole numbers stay exact."""
        assert self.rules is not None
        return row_stamps(self.table, self.rules)

    def _reader(self, kind: StreamKind) -> Any:
        assert self.rules is not None
        if kind == "cloud":
            names = self._column("file")
            return lambda row: read_cloud_file(self._cloud(names[row]))
        if kind == "wrench":
            unit = NEWTONS[self.rules.force_unit]
            forces = unit * np.stack([self._numbers(axis) for axis in _FORCE], axis=-1)
            return np.concatenate([forces, np.zeros_like(forces)], axis=1).__getitem__
        unit = METRES[self.rules.length_unit]
        places = unit * np.stack([self._numbers(axis) for axis in "xyz"], axis=-1)
        turns = row_quaternions(self.table, self.rules)
        return np.concatenate([places, turns], axis=1).__getitem__

    def _cloud(self, name: str) -> Path:
        path = self.path.parent / name.replace("\\", "/")
        if path.suffix.lower() not in CLOUD_SUFFIXES:
            raise DatasetError(
                f"{self.path.name} names '{name[:80]}'; expected {', '.join(CLOUD_SUFFIXES)}",
                file=self.path.name,
                value=name[:80],
            )
        return path
