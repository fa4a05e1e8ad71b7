"""The result rows of a sweep on disk, appended as its points finish."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from palpate.foundation.errors import RunError

__all__ = ["ResultRows"]


class ResultRows:
    """The rows of one sweep: one JSON object a line, each flushed to disk before the next.

    Args:
        file: the file of the rows.
    """

    def __init__(self, file: Path) -> None:
        self._file = file

    def read(self) -> list[dict[str, Any]]:
        """Return all complete rows; an incomplete last line, left by a kill, is ignored.

        Raises RunError for a complete line that is not JSON.
        """
        if not self._file.is_file():
            return []
        lines = self._file.read_text(errors="replace").split("\n")
        rows: list[dict[str, Any]] = []
        for number, line in enumerate(lines[:-1], 1):
            try:
                rows.append(json.loads(line))
            except ValueError as error:
                raise RunError(
                    f"{self._file.name}, row {number} cannot be read ({error}); remove the row",
                    row=number,
                ) from error
        return rows

    def start(self, rows: Sequence[dict[str, Any]]) -> None:
        """Replace the file by these rows, so that no row follows an incomplete one."""
        aside = self._file.with_name(f".{self._file.name}.part")
        aside.write_text("".join(json.dumps(row) + "\n" for row in rows))
        os.replace(aside, self._file)

    def add(self, row: dict[str, Any]) -> None:
        """Append one row."""
        with self._file.open("a") as stream:
            stream.write(json.dumps(row) + "\n")
            stream.flush()
            os.fsync(stream.fileno())
