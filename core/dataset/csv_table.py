"""Reader for tables of numbers as csv, with the row of every error.

Rows are counted as in an editor: the header is row 1, the first numbers are row 2.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from palpate.dataset.files import problem, read_lines
from palpate.foundation.arrays import FloatArray
from palpate.foundation.errors import DatasetError

__all__ = [
    "FIRST_ROW",
    "LARGEST_COORDINATE",
    "check_coordinates",
    "check_increasing",
    "read_labelled",
    "read_numbers",
    "row_problems",
]

FIRST_ROW = 2
"""Number of the first row of numbers."""
LARGEST_COORDINATE = 10.0
"""Largest plausible coordinate [m]; a larger one has another unit."""
LATEST = 1e11
"""Latest plausible time stamp [s]; since 1970 it is 1.8e9 s, so a larger one has another unit."""
_LIMIT = 2**29
"""Largest size of a table [bytes]."""
_MOST_EMPTY = 1_000_000
"""Empty rows in a row after which a table is given up."""
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)


def read_numbers(root: Path, file: str, header: str) -> FloatArray:
    """Read all rows (n, columns), n >= 1, below exactly this header; every number is finite."""
    columns = header.count(",") + 1
    blocks = [_block(file, lines, header, row) for row, lines in _body(root, file, header)]
    numbers = np.concatenate(blocks).reshape(-1, columns)
    numbers.setflags(write=False)
    return numbers


def read_labelled(root: Path, file: str, header: str, label: int) -> tuple[list[str], FloatArray]:
    """Read a table with one column of words at index `label`.

    Returns:
        the words, and the numbers (n, columns - 1).
    """
    names = header.split(",")
    words: list[str] = []
    numbers: list[list[float]] = []
    for row, line in _single(_body(root, file, header)):
        cells = _cells(file, line, header, row)
        word = cells.pop(label)
        if not word:
            raise problem(
                file,
                f"an empty {names[label]}; expected a name: fill it in",
                row=row,
                key=names[label],
            )
        words.append(word)
        keys = names[:label] + names[label + 1 :]
        numbers.append(
            [_number(file, cell, row, key) for cell, key in zip(cells, keys, strict=True)]
        )
    array = np.array(numbers)
    array.setflags(write=False)
    return words, array


def row_problems(
    root: Path, file: str, header: str, label: int | None = None, most: int = 20
) -> list[DatasetError]:
    """Problems of single rows of a table, one for each row, at most `most`.

    Args:
        root: of the dataset.
        file: relative to `root`.
        header: expected.
        label: index of a column of words; None without.
        most: largest number of problems.
    """
    problems: list[DatasetError] = []
    names = header.split(",")
    rows = _single(_body(root, file, header))
    while len(problems) < most:
        try:
            row, line = next(rows)
        except StopIteration:
            break
        except DatasetError as error:
            return [*problems, error]
        try:
            for place, cell in enumerate(_cells(file, line, header, row)):
                if place != label:
                    _number(file, cell, row, names[place])
        except DatasetError as error:
            problems.append(error)
    return problems


def check_increasing(file: str, time: FloatArray) -> None:
    """Reject a time column (n,) [s] that does not increase, or is not in seconds."""
    if len(late := np.flatnonzero(np.abs(time) > LATEST)):
        value = f"{time[late[0]]:g}"
        text = (
            f"t = {value} s; expected seconds, since any start: did you write milliseconds or "
            "nanoseconds?"
        )
        raise problem(file, text, row=int(late[0]) + FIRST_ROW, key="t", value=value)
    bad = np.flatnonzero(np.diff(time) <= 0)
    if len(bad):
        at = int(bad[0])
        before, after = repr(float(time[at])), repr(float(time[at + 1]))
        told = f"t = {after} s does not increase (row {at + FIRST_ROW}: {before} s)"
        steps = np.diff(time)
        if before == after and (steps >= 0).all():
            text = (
                f"{told}; {(steps == 0).sum()} of {len(time)} stamps repeat the one before: were "
                "they written with too few digits, as %g writes six? Write all digits, and keep "
                "each stamp once"
            )
        else:
            text = f"{told}; sort the rows by time and keep each stamp once"
        raise problem(file, text, row=at + 1 + FIRST_ROW, key="t", value=after)


def check_coordinates(file: str, points: FloatArray, first_row: int = FIRST_ROW) -> None:
    """Reject positions (n, 3) [m] with a number that is not finite or implausibly large."""
    within = np.abs(points) <= LARGEST_COORDINATE
    if not within.all():
        at, axis = (int(number) for number in np.argwhere(~within)[0])
        value = float(points[at, axis])
        found = f"{'xyz'[axis]} = {value:g}"
        if math.isfinite(value):
            advice = (
                f" m; expected metres, at most {LARGEST_COORDINATE:g} m from the origin: did "
                "you write millimetres or centimetres?"
            )
        else:
            advice = (
                "; expected a finite number of metres: leave out points and rows without a "
                "measurement"
            )
        raise problem(file, found + advice, row=at + first_row, key="xyz"[axis], value=f"{value:g}")


def _body(root: Path, file: str, header: str) -> Iterator[tuple[int, list[str]]]:
    """Blocks of rows below the header, each with the number of its first row; empty rows at the
    end are left out.
    """
    row, empty, any_row = 1, 0, False
    for lines in read_lines(root, file, _LIMIT):
        if row == 1:
            _check_header(file, lines.pop(0), header)
            row = FIRST_ROW
        filled = len(lines)
        while filled and not lines[filled - 1].strip(" "):
            filled -= 1
        if filled:
            yield row, [""] * empty + lines[:filled]
            row, empty, any_row = row + empty + filled, 0, True
        empty += len(lines) - filled
        if empty > _MOST_EMPTY:
            text = f"more than {_MOST_EMPTY} empty rows follow; expected numbers"
            raise problem(file, f"{text}: check what was exported", row=row)
    if not any_row:
        raise problem(
            file,
            "has a header but no rows; expected at least one: export this file again",
            row=FIRST_ROW,
        )


def _single(blocks: Iterable[tuple[int, list[str]]]) -> Iterator[tuple[int, str]]:
    """Single rows with their numbers."""
    for first, lines in blocks:
        yield from enumerate(lines, first)


def _check_header(file: str, line: str, header: str) -> None:
    found = ",".join(cell.strip() for cell in line.split(","))
    if found != header:
        text = (
            f"the header is '{found[:80]}'; expected '{header}': name and order the columns "
            "like this"
        )
        raise problem(file, text, row=1, value=found[:80])


def _block(file: str, lines: list[str], header: str, first_row: int) -> FloatArray:
    commas = header.count(",")
    text = "".join(lines)
    if text.isascii() and "_" not in text and all(line.count(",") == commas for line in lines):
        try:
            numbers = np.fromiter(
                map(float, chain.from_iterable(line.split(",") for line in lines)), dtype=float
            )
        except ValueError:
            pass
        else:
            if np.isfinite(numbers).all():
                return numbers
    return _slow_block(file, lines, header, first_row)


def _slow_block(file: str, lines: list[str], header: str, first_row: int) -> FloatArray:
    names = header.split(",")
    numbers: list[float] = []
    for row, line in enumerate(lines, first_row):
        cells = _cells(file, line, header, row)
        numbers.extend(
            _number(file, cell, row, key) for cell, key in zip(cells, names, strict=True)
        )
    return np.array(numbers)


def _cells(file: str, line: str, header: str, row: int) -> list[str]:
    cells = [cell.strip() for cell in line.split(",")]
    columns = header.count(",") + 1
    if len(cells) != columns:
        found = "an empty line" if not line.strip() else f"{len(cells)} columns"
        raise problem(
            file,
            f"{found}; expected {columns} columns ({header}): complete or remove this row",
            row=row,
            value=line[:80],
        )
    return cells


def _number(file: str, cell: str, row: int, key: str) -> float:
    if not _NUMBER.fullmatch(cell):
        text = (
            f"{key} = '{cell[:40]}'; expected a finite number with a decimal point: correct "
            "or remove this row"
        )
        raise problem(file, text, row=row, key=key, value=cell[:40])
    number = float(cell)
    if not math.isfinite(number):
        raise problem(
            file,
            f"{key} = '{cell[:40]}' is too large for a number; correct this row",
            row=row,
            key=key,
            value=cell[:40],
        )
    return number
