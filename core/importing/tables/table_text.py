"""Tables of numbers and words in any dialect of csv, as columns."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = ["TextTable", "read_table"]

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?nan|[+-]?inf", re.I | re.ASCII)
_LIMIT = 2**31
"""Largest size of a table [bytes]."""
_SAMPLE = 50
"""Lines by which the dialect is told."""


@dataclass(frozen=True, eq=False)
class TextTable:
    """A table as columns of texts.

    Attributes:
        file: name of its file.
        columns: texts by the name of the column, or by its number from 1 without a header.
        lines: line of each row in the file, from 1.
        has_header: whether the file names its columns.
        comma_decimals: whether numbers have a decimal comma.
    """

    file: str
    columns: dict[str, list[str]]
    lines: tuple[int, ...]
    has_header: bool
    comma_decimals: bool = False

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()), []))

    def head(self, rows: int) -> TextTable:
        """The first rows as a table."""
        columns = {name: texts[:rows] for name, texts in self.columns.items()}
        return replace(self, columns=columns, lines=self.lines[:rows])

    def numbers(self, column: str) -> FloatArray:
        """A column as numbers (n,); DatasetError names the row of what is none."""
        texts = self.texts(column)
        if self.comma_decimals:
            texts = [one.replace(",", ".") for one in texts]
        try:
            return np.array(texts, dtype=float)
        except ValueError:
            at = next(n for n, one in enumerate(texts) if not _NUMBER.fullmatch(one.strip()))
            raise DatasetError(
                f"{self.file}, row {self.lines[at]}: {column} = '{texts[at][:40]}'; expected "
                "a number: correct or remove this row",
                file=self.file,
                row=self.lines[at],
                key=column,
            ) from None

    def whole(self, column: str) -> list[int] | None:
        """A column as whole numbers, exactly; None where any is none."""
        try:
            return [int(one) for one in self.texts(column)]
        except ValueError:
            return None

    def texts(self, column: str) -> list[str]:
        """A column as it stands; DatasetError for an unknown one."""
        if column not in self.columns:
            raise DatasetError(
                f"{self.file} has no column '{column}'; it has {', '.join(self.columns)}: correct "
                "the mapping of columns",
                file=self.file,
                key=column,
            )
        return self.columns[column]


def read_table(path: Path) -> TextTable:
    """Read a table of any dialect: separators, quotes, decimal commas, comments, byte order marks.

    Lines that begin with # or % are comments, but for a header such as "%time" of rostopic.
    """
    lines = [
        (number, line)
        for number, line in enumerate(_decoded(path).splitlines(), 1)
        if line.strip() and not _is_comment(line)
    ]
    if not lines:
        raise DatasetError(
            f"{path.name} holds no rows; expected a table: export it again", file=path.name
        )
    sample = [line for _, line in lines[:_SAMPLE]]
    separator = _separator(sample)
    comma = separator != "," and _has_decimal_commas(sample, separator)
    rows = _split([line for _, line in lines], separator)
    header = None if _is_data(rows[0], comma) else rows.pop(0)
    if not rows:
        raise DatasetError(
            f"{path.name} has a header but no rows; expected numbers: export it again",
            file=path.name,
        )
    numbers = [number for number, _ in lines[0 if header is None else 1 :]]
    width = len(rows[0]) if header is None else len(header)
    for at, row in enumerate(rows):
        if len(row) != width:
            if at == len(rows) - 1:
                rows.pop()  # a recording that was cut off in its last row
                break
            raise DatasetError(
                f"{path.name}, row {numbers[at]}: {len(row)} columns; expected {width}: complete "
                "or remove this row",
                file=path.name,
                row=numbers[at],
            )
    names = _names(header, width)
    columns = {name: [row[at] for row in rows] for at, name in enumerate(names)}
    return TextTable(path.name, columns, tuple(numbers), header is not None, comma)


def _decoded(path: Path) -> str:
    if path.stat().st_size > _LIMIT:
        raise DatasetError(
            f"{path.name} is larger than {_LIMIT // 2**20} MiB; expected less: split it",
            file=path.name,
        )
    data = path.read_bytes()
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        return data.decode("utf-16", "replace")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _is_comment(line: str) -> bool:
    start = line.lstrip()
    return start.startswith(("#", "%")) and not start.lower().startswith(
        ("%time", "#time", "# time")
    )


def _separator(lines: list[str]) -> str:
    """The character that splits all lines into equally many cells, most of them."""
    best, most = " ", 1
    for candidate in (";", "\t", ",", " "):
        counts = {len(row) for row in _split(lines[1:] or lines, candidate)}
        # The last line may be cut off, so that two counts are no contradiction by themselves.
        common = max(counts)
        if common > most and len(counts) <= 2:
            best, most = candidate, common
            if candidate != ",":
                break
    return best


def _split(lines: list[str], separator: str) -> list[list[str]]:
    if separator == " ":
        return [line.split() for line in lines]
    reader = csv.reader(lines, delimiter=separator, skipinitialspace=True)
    return [[cell.strip() for cell in row] for row in reader]


def _has_decimal_commas(lines: list[str], separator: str) -> bool:
    cells = [cell for row in _split(lines, separator) for cell in row]
    return any(re.fullmatch(r"[+-]?\d+,\d+([eE][+-]?\d+)?", cell) for cell in cells)


def _is_data(row: list[str], comma: bool) -> bool:
    """Whether a row holds numbers, a name of a frame or file among them at most."""
    cells = [cell.replace(",", ".") if comma else cell for cell in row]
    return sum(bool(_NUMBER.fullmatch(cell)) for cell in cells) >= max(1, len(cells) / 2)


def _names(header: list[str] | None, width: int) -> list[str]:
    if header is None:
        return [str(number + 1) for number in range(width)]
    names = [cell.strip().lstrip("#").strip() or str(at + 1) for at, cell in enumerate(header)]
    return [
        name if names.index(name) == at else f"{name} ({at + 1})" for at, name in enumerate(names)
    ]
