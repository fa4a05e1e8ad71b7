"""Sweeps on disk, below the runs folder; a sweep's points are readable while it runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from palpate.app.storage.result_store import ResultStore
from palpate.sweep.result_rows import ResultRows

__all__ = ["REPLAY_CACHE", "SWEEPS", "SweepStore"]

SWEEPS, REPLAY_CACHE = "sweeps", ".replays"


class SweepStore(ResultStore):
    """The folder of sweeps."""

    def __init__(self, runs: Path) -> None:
        super().__init__(runs / SWEEPS, "sweep", "request.json", "summary.json")

    @property
    def replay_cache(self) -> Path:
        """Folder of replays by their content, shared by all sweeps."""
        return self.folder / REPLAY_CACHE

    def points(self, name: str) -> list[dict[str, Any]]:
        """Finished points in the order of their first ends; failed ones with their reason.

        A point that was evaluated again, by other code, has its last row.
        """
        rows = ResultRows(self.folder / name / "points.jsonl").read()
        return list({row["number"]: row for row in rows}.values())
