"""Sweeps on disk: a folder each, below the runs folder, written by the work and read by the page
while it runs.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from palpate.app.http_errors import Missing
from palpate.app.storage.run_store import NAME
from palpate.foundation.errors import RunError
from palpate.sweep.result_rows import ResultRows

__all__ = ["Sweeps"]

FOLDER, STORE = "sweeps", ".replays"


class Sweeps:
    """The folder of sweeps; `store` keeps the replays that all of them share."""

    def __init__(self, runs: Path) -> None:
        self.folder = runs / FOLDER

    @property
    def store(self) -> Path:
        """Of replays by their content."""
        return self.folder / STORE

    def names(self) -> list[str]:
        """All sweeps that have begun, the newest first."""
        found = [
            path.parent
            for path in self.folder.glob("*/request.json")
            if NAME.fullmatch(path.parent.name)
        ]
        return [
            path.name for path in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)
        ]

    def begun(self, name: str) -> bool:
        """Whether anything of it is on disk."""
        return bool(NAME.fullmatch(name)) and (self.folder / name / "request.json").is_file()

    def request(self, name: str) -> dict[str, Any]:
        """What was asked."""
        if not self.begun(name):
            raise Missing(
                f"there is no sweep {name}; GET /api/sweeps lists those there are", sweep=name
            )
        return self._json(name, "request.json")

    def summary(self, name: str) -> dict[str, Any] | None:
        """What it found; None before its end."""
        return (
            self._json(name, "summary.json")
            if (self.folder / name / "summary.json").is_file()
            else None
        )

    def points(self, name: str) -> list[dict[str, Any]]:
        """The points that have ended, in that order; those that failed with their reason."""
        return ResultRows(self.folder / name / "points.jsonl").read()

    def _json(self, name: str, file: str) -> dict[str, Any]:
        try:
            value: dict[str, Any] = json.loads((self.folder / name / file).read_text())
        except (OSError, ValueError) as error:
            raise RunError(
                f"sweep {name}: {file} cannot be read ({error}); make the sweep again",
                sweep=name,
                file=file,
            ) from error
        return value
