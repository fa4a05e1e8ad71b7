"""Sweeps on disk: a folder each, below the runs folder, written by the work and read by the page while it runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from app.problems import Missing
from app.runs import NAME
from core.errors import RunError
from core.progress import Report
from core.sweeping.rows import Rows

__all__ = ["Sweeps", "sweep"]

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
        found = [path.parent for path in self.folder.glob("*/request.json") if NAME.fullmatch(path.parent.name)]
        return [path.name for path in sorted(found, key=lambda path: path.stat().st_mtime, reverse=True)]

    def begun(self, name: str) -> bool:
        """Whether anything of it is on disk."""
        return bool(NAME.fullmatch(name)) and (self.folder / name / "request.json").is_file()

    def request(self, name: str) -> dict[str, Any]:
        """What was asked."""
        if not self.begun(name):
            raise Missing(f"there is no sweep {name}; GET /api/sweeps lists those there are", sweep=name)
        return self._json(name, "request.json")

    def summary(self, name: str) -> dict[str, Any] | None:
        """What it found; None before its end."""
        return self._json(name, "summary.json") if (self.folder / name / "summary.json").is_file() else None

    def points(self, name: str) -> list[dict[str, Any]]:
        """The points that have ended, in that order; those that failed with their reason."""
        return Rows(self.folder / name / "points.jsonl").read()

    def _json(self, name: str, file: str) -> dict[str, Any]:
        try:
            value: dict[str, Any] = json.loads((self.folder / name / file).read_text())
        except (OSError, ValueError) as error:
            raise RunError(f"sweep {name}: {file} cannot be read ({error}); make the sweep again", sweep=name, file=file) from error
        return value


def sweep(request: dict[str, Any], report: Report) -> dict[str, Any]:
    """The job: sweep `request["dataset"]` as `request["sweep"]` asks; the folder has the name of the job."""
    from core.dataset import open_dataset  # noqa: PLC0415 (heavy)
    from core.dataset.accepted import Accepted  # noqa: PLC0415 (heavy)
    from core.sweeping.request import Request  # noqa: PLC0415 (heavy)
    from core.sweeping.running import run_sweep  # noqa: PLC0415 (heavy)

    registered = request.get("registration")
    dataset = open_dataset(Path(request["dataset"])).registered(Accepted.from_json(registered) if registered else None)
    sweeps, name = Sweeps(Path(request["runs"])), Path(request["scratch"]).name
    found = run_sweep(
        dataset, Request.from_json(request["sweep"]), sweeps.folder / name, store=sweeps.store,
        workers=int(request["workers"]), scheduler=request["scheduler"], report=report,
    )  # fmt: skip
    return {"sweep": name, "points": found["points"], "failed": found["failed"]}
