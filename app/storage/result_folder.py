"""What long verbs leave below the runs folder, a folder for each: written by the work, read by the
page while it runs.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from palpate.app.http_errors import Missing
from palpate.app.schemas import JobOut
from palpate.app.storage.run_store import NAME
from palpate.foundation.errors import RunError

if TYPE_CHECKING:
    from palpate.app.services import Desk

__all__ = ["Kept"]


class Kept:
    """Folders of one kind of job.

    Args:
        runs: the runs folder.
        kind: of the jobs.
        folder: below it.
        asked: file that is there from the beginning on.
        found: file that is there at the end.
    """

    def __init__(self, runs: Path, kind: str, folder: str, asked: str, found: str) -> None:
        self.folder, self.kind, self._asked, self._found = runs / folder, kind, asked, found

    def names(self) -> list[str]:
        """All that have begun, the newest first."""
        begun = [
            path.parent
            for path in self.folder.glob(f"*/{self._asked}")
            if NAME.fullmatch(path.parent.name)
        ]
        return [
            path.name for path in sorted(begun, key=lambda path: path.stat().st_mtime, reverse=True)
        ]

    def finished(self) -> list[str]:
        """Those that have ended, the newest first."""
        return [name for name in self.names() if self.found(name) is not None]

    def asked(self, name: str) -> dict[str, Any]:
        """What was asked; Missing where nothing has begun."""
        value = self.read(name, self._asked)
        if value is None:
            raise Missing(
                f"there is no {self.kind} {name}; GET /api/{self.folder.name} lists those there are",
                **{self.kind: name},
            )
        return dict(value)

    def found(self, name: str) -> dict[str, Any] | None:
        """What came of it; None before its end."""
        value = self.read(name, self._found)
        return None if value is None else dict(value)

    def read(self, name: str, file: str) -> Any:
        """One of its files; None where it is not there."""
        path = self.folder / name / file
        if not NAME.fullmatch(name) or not path.is_file():
            return None
        try:
            return json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise RunError(
                f"{self.kind} {name}: {file} cannot be read ({error}); make it again", file=file
            ) from error

    def listed(self, desk: Desk) -> list[dict[str, Any]]:
        """All of them, the newest first, each with its job where that is still known."""
        jobs = {
            job.id: JobOut.of(job).model_dump() for job in desk.jobs.all() if job.kind == self.kind
        }
        known = self.names()
        names = [*(name for name in jobs if name not in known), *known]
        return [
            {"id": name, "job": jobs.get(name), **self._told(name, name in known)} for name in names
        ]

    def one(self, name: str, desk: Desk) -> dict[str, Any]:
        """One: its job, what was asked and what came of it; Missing where there is neither job nor
        folder.
        """
        job, begun = self.job(name, desk), self.read(name, self._asked) is not None
        if job is None and not begun:
            self.asked(name)
        return {"id": name, "job": job, **self._told(name, begun)}

    def job(self, name: str, desk: Desk) -> dict[str, Any] | None:
        """Its job, if the record is there."""
        try:
            job = desk.jobs.get(name)
        except Missing:
            return None
        return JobOut.of(job).model_dump() if job.kind == self.kind else None

    def cancel(self, name: str, desk: Desk) -> JobOut:
        """Stop it."""
        if self.job(name, desk) is None:
            raise Missing(
                f"there is no {self.kind} {name} that could be stopped", **{self.kind: name}
            )
        return JobOut.of(desk.jobs.cancel(name))

    def _told(self, name: str, begun: bool) -> Mapping[str, Any]:
        asked = self.asked(name) if begun and self._asked != self._found else None
        return {"request": asked, "summary": self.found(name) if begun else None}
