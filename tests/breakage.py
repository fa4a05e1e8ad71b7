"""One way to break a dataset, and the edits it is made of: each takes a file and returns a function
of the folder.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

__all__ = [
    "Breakage",
    "change",
    "change_rows",
    "keep_rows",
    "make_folder",
    "remove",
    "replace",
    "scale_columns",
    "set_cell",
    "write",
]


@dataclass(frozen=True)
class Breakage:
    """One way to break a dataset, and what its error has to tell."""

    breaks: Callable[[Path], object]
    where: dict[str, Any]
    says: tuple[str, ...]

    def __call__(self, folder: Path) -> None:
        self.breaks(folder)


def remove(file: str) -> Callable[[Path], None]:
    """Remove a file or folder."""

    def breaks(folder: Path) -> None:
        path = folder / file
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return breaks


def write(file: str, content: bytes | str) -> Callable[[Path], object]:
    """Write a file anew."""
    data = content.encode() if isinstance(content, str) else content
    return lambda folder: (folder / file).write_bytes(data)


def change(file: str, by: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    """Pass the bytes of a file through a function."""
    return lambda folder: (folder / file).write_bytes(by((folder / file).read_bytes()))


def replace(file: str, old: str | bytes, new: str | bytes) -> Callable[[Path], object]:
    """Replace the first occurrence; an absent one is a mistake of the test."""
    before, after = (text.encode() if isinstance(text, str) else text for text in (old, new))

    def once(data: bytes) -> bytes:
        if before not in data:
            raise LookupError(f"{file} holds no {before!r} to break")
        return data.replace(before, after, 1)

    return change(file, once)


def change_rows(
    file: str, row: int, by: Callable[[list[str]], list[str]]
) -> Callable[[Path], object]:
    """Change the cells of one row, or with row 0 of all but the header."""

    def breaks(folder: Path) -> None:
        lines = (folder / file).read_text().splitlines()
        for number in [row] if row else range(2, len(lines) + 1):
            lines[number - 1] = ",".join(by(lines[number - 1].split(",")))
        (folder / file).write_text("\n".join(lines) + "\n")

    return breaks


def set_cell(file: str, row: int, column: int, text: str) -> Callable[[Path], object]:
    """Write another text into one cell, rows as an editor counts them."""
    return change_rows(
        file, row, lambda cells: [text if i == column else cell for i, cell in enumerate(cells)]
    )


def scale_columns(file: str, columns: range, factor: float) -> Callable[[Path], object]:
    """Multiply the numbers of some columns."""

    def scaled(cells: list[str]) -> list[str]:
        return [
            f"{float(cell) * factor:.9f}" if i in columns else cell for i, cell in enumerate(cells)
        ]

    return change_rows(file, 0, scaled)


def keep_rows(file: str, count: int) -> Callable[[Path], object]:
    """Keep the first rows, the header among them."""
    return change(file, lambda data: b"".join(data.splitlines(keepends=True)[:count]))


def make_folder(file: str) -> Callable[[Path], None]:
    """Put an empty folder in the place of a file."""

    def breaks(folder: Path) -> None:
        (folder / file).unlink()
        (folder / file).mkdir()

    return breaks
