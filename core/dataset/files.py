"""Safe reading of files in a dataset folder: only regular files inside of it, of limited size."""

from __future__ import annotations

import codecs
import os
import stat
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from palpate.foundation.errors import DatasetError

__all__ = ["open_inside", "problem", "read_lines", "read_text", "read_toml"]

_BLOCK, _LONGEST = 2**20, 2**16
"""Bytes that are read at once, and of the longest line."""


def problem(
    file: str, text: str, *, row: int | None = None, key: str | None = None, value: object = None
) -> DatasetError:
    """Make the error for a place in a dataset.

    Args:
        file: relative to the dataset.
        text: the sentence; it names the key itself if needed.
        row: line in the file; the header is row 1.
        key: name of a key or of a column.
        value: the wrong value.
    """
    shown = value if value is None or isinstance(value, int | str) else str(value)
    place = file + (f", row {row}" if row is not None else "")
    return DatasetError(f"{place}: {text}", file=file, row=row, key=key, value=shown)


def open_inside(root: Path, file: str, within: str = "") -> BinaryIO:
    """Open `file`, relative to `root`; links may not lead out of `root/within`."""
    path = root / file
    try:
        kind = path.stat().st_mode
    except FileNotFoundError:
        raise problem(
            file, "not found; expected this file: add it, or correct the name that refers to it"
        ) from None
    except (OSError, ValueError) as error:
        raise problem(
            file,
            f"cannot be looked at ({_reason(error)}); check the name and the rights of this file",
        ) from error
    if not stat.S_ISREG(kind):
        found = "a folder" if stat.S_ISDIR(kind) else "not a regular file"
        raise problem(file, f"is {found}; expected a plain file: put the file itself here")
    home = os.path.realpath(root / within)
    if os.path.commonpath([home, os.path.realpath(path)]) != home:
        raise problem(
            file,
            "leads out of its folder through a link; expected a file inside: copy the file "
            "itself here",
        )
    try:
        return path.open("rb")
    except OSError as error:
        raise problem(
            file, f"cannot be opened ({_reason(error)}); check the rights of this file"
        ) from error


def read_text(root: Path, file: str, limit: int) -> str:
    """Read a UTF-8 file of at most `limit` bytes, with \\n line ends and without a byte order
    mark.
    """
    with open_inside(root, file) as stream:
        data = _read(stream, file, limit + 1)
    if len(data) > limit:
        raise _too_large(file, limit)
    return _decoded(data.removeprefix(codecs.BOM_UTF8), file, 1)


def read_lines(root: Path, file: str, limit: int) -> Iterator[list[str]]:
    """Read the lines of a UTF-8 file as `read_text` does, in blocks of about a megabyte.

    A line of more than 64 KiB is refused.
    """
    with open_inside(root, file) as stream:
        row, size, begun, mark = 1, 0, b"", codecs.BOM_UTF8
        while block := _read(stream, file, _BLOCK):
            if (size := size + len(block)) > limit:
                raise _too_large(file, limit)
            whole, end, rest = (begun + block).removeprefix(mark).rpartition(b"\n")
            mark = b""
            if end:
                lines = _decoded(whole, file, row).split("\n")
                row += len(lines)
                yield lines
            if len(rest) > _LONGEST:
                text = f"is longer than {_LONGEST // 2**10} KiB; expected a row of a table"
                raise problem(file, f"{text}: check what was exported", row=row)
            begun = rest
        yield [_decoded(begun, file, row)]


def _read(stream: BinaryIO, file: str, most: int) -> bytes:
    try:
        return stream.read(most)
    except OSError as error:
        raise problem(
            file, f"cannot be read ({_reason(error)}); check the disk and copy the file again"
        ) from error


def _too_large(file: str, limit: int) -> DatasetError:
    return problem(
        file,
        f"is larger than {limit // 2**20} MiB; expected far less of such a file: check what was "
        "exported",
    )


def _decoded(data: bytes, file: str, first_row: int) -> str:
    """Decode UTF-8 that begins in row `first_row`, with \\n line ends."""
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        row = data.count(b"\n", 0, error.start) + first_row
        found = f"byte 0x{data[error.start]:02x} is not UTF-8 text; save the file as UTF-8"
        raise problem(file, found, row=row) from None
    return text.replace("\r\n", "\n").removesuffix("\r")


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def read_toml(root: Path, file: str, limit: int) -> dict[str, Any]:
    """Read a TOML file of at most `limit` bytes, relative to `root`."""
    text = read_text(root, file, limit)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        # tomllib ends its message with "(at line 3, column 8)".
        tail = str(error).rpartition("at line ")[2].partition(",")[0]
        row = int(tail) if tail.isdecimal() else None
        raise problem(
            file, f"is not valid TOML: {error}; correct the syntax there", row=row
        ) from None
