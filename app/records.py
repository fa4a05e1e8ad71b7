"""Job records in SQLite: what was asked, how far it is, how it ended."""

from __future__ import annotations

import json
import sqlite3
import threading
import time
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from app.problems import Missing

__all__ = ["Job", "JobState", "Records"]

SCHEMA = """
create table if not exists jobs (
    id text primary key, kind text not null, request text not null, state text not null, fraction real not null,
    text text not null, created real not null, started real, finished real, error text, result text
)"""


class JobState(StrEnum):
    """Where a job stands; the last three are final."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"

    @property
    def is_finished(self) -> bool:
        """Whether nothing will change any more."""
        return self in (JobState.DONE, JobState.FAILED, JobState.CANCELLED)


@dataclass(frozen=True, kw_only=True)
class Job:
    """A copy of one record; times are seconds since 1970, `fraction` runs from 0 to 1."""

    id: str
    kind: str
    request: dict[str, Any]
    state: JobState = JobState.QUEUED
    fraction: float = 0.0
    text: str = "waiting for its turn"
    created: float = field(default_factory=time.time)
    started: float | None = None
    finished: float | None = None
    error: dict[str, Any] | None = None
    result: dict[str, Any] | None = None


COLUMNS = tuple(Job.__dataclass_fields__)
JSON_COLUMNS = ("request", "error", "result")


class Records:
    """The table of jobs; every method may be called from any thread."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        self._database = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
        self._database.execute("pragma journal_mode=wal")
        self._database.execute(SCHEMA)
        self.version = 0

    def add(self, job: Job) -> None:
        """A new record."""
        values = [_stored(name, getattr(job, name)) for name in COLUMNS]
        self._change(f"insert into jobs ({', '.join(COLUMNS)}) values ({', '.join('?' * len(COLUMNS))})", values)

    def update(self, identity: str, **values: Any) -> None:
        """New values for some columns, unless the job has already finished."""
        assignments = ", ".join(f"{name} = ?" for name in values)
        stored = [_stored(name, value) for name, value in values.items()]
        self._change(f"update jobs set {assignments} where id = ? and state in ('queued', 'running')", [*stored, identity])

    def fail_unfinished(self, message: str) -> None:
        """Close every record that was left open by a server that ended."""
        error = json.dumps({"kind": "Interrupted", "message": message, "where": {}})
        self._change(
            "update jobs set state = 'failed', error = ?, finished = ? where state in ('queued', 'running')", [error, time.time()]
        )

    def get(self, identity: str) -> Job:
        """One job, or Missing."""
        for job in self._select("where id = ?", [identity]):
            return job
        raise Missing(f"there is no job {identity}", job=identity)

    def all(self) -> list[Job]:
        """All jobs, the newest first."""
        return self._select("order by created desc", [])

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def _select(self, rest: str, values: list[Any]) -> list[Job]:
        with self._lock:
            rows = self._database.execute(f"select {', '.join(COLUMNS)} from jobs {rest}", values).fetchall()
        return [_job(row) for row in rows]

    def _change(self, statement: str, values: list[Any]) -> None:
        with self._lock:
            self._database.execute(statement, values)
            self.version += 1


def _stored(name: str, value: Any) -> Any:
    return json.dumps(value) if name in JSON_COLUMNS and value is not None else value


def _job(row: tuple[Any, ...]) -> Job:
    values = dict(zip(COLUMNS, row, strict=True))
    for name in JSON_COLUMNS:
        values[name] = None if values[name] is None else json.loads(values[name])
    values["state"] = JobState(values["state"])
    return Job(**values)
