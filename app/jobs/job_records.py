"""Job records in SQLite: request, progress and result."""

from __future__ import annotations

import json
import logging
import os
import sqlite3
import threading
import time
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

from palpate.app.http_errors import Missing, NoSpace, disk_is_full
from palpate.foundation.errors import RunError

__all__ = ["Job", "JobRecords", "JobState", "Note"]

log = logging.getLogger(__name__)
SCHEMA = (
    """create table if not exists jobs (
    id text primary key, kind text not null, request text not null, state text not null,
    fraction real not null, text text not null, created real not null, started real,
    finished real, error text, result text, attempt integer not null default 1, key text,
    seconds real not null default 0
)""",
    """create table if not exists log (
    job text not null, at real not null, level text not null, text text not null
)""",
    "create index if not exists log_of_job on log (job)",
)
KEYS = "create unique index if not exists jobs_by_key on jobs (key)"
LATER = {
    "attempt": "integer not null default 1",
    "key": "text",
    "seconds": "real not null default 0",
}
"""Columns that files of earlier versions lack."""
VERSION = 1
"""Version of the file; 0 before versions were kept. Raised with every change of its tables."""
FORESEEN = 0.03
"""Share of a job that must be done before its remaining time is estimated [1]."""
MOST_NOTES = 5000
"""Lines that are stored of one job: the first ones of a longer log."""


class JobState(StrEnum):
    """State of a job; the last four are final until a retry."""

    QUEUED = "queued"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    CANCELLED = "cancelled"
    INTERRUPTED = "interrupted"

    @property
    def is_finished(self) -> bool:
        """Whether the state is final until a retry."""
        return self not in (JobState.QUEUED, JobState.RUNNING)

    @property
    def can_be_retried(self) -> bool:
        """Whether the job ended without its result."""
        return self.is_finished and self is not JobState.DONE


@dataclass(frozen=True, kw_only=True)
class Job:
    """A copy of one record; times are seconds since 1970, `fraction` runs from 0 to 1.

    `seconds` is how long its process has run [s], at the last progress and at the end, by a clock
    that nobody sets. `attempt` counts from 1. `key` names the request, so that a repeated request
    does not make another job.
    """

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
    attempt: int = 1
    key: str | None = None
    seconds: float = 0.0

    @property
    def remaining(self) -> float | None:
        """Estimated remaining time [s] at the average speed so far; None before it can be
        estimated.
        """
        if self.state is not JobState.RUNNING or self.started is None or self.fraction < FORESEEN:
            return None
        return self.seconds / self.fraction * (1.0 - self.fraction)


@dataclass(frozen=True)
class Note:
    """One line of a job's log: time [s since 1970], level (info, warning, error), text."""

    at: float
    level: str
    text: str


COLUMNS = tuple(Job.__dataclass_fields__)
JSON_COLUMNS = ("request", "error", "result")


class JobRecords:
    """The table of jobs; every method may be called from any thread.

    A change raises NoSpace where the disk is full. A file of an earlier version is copied beside
    itself, as `jobs-version-0.sqlite`, before its tables are changed; RunError for one of a later
    version, or a damaged one.
    """

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        try:
            self._database = _opened(path)
        except sqlite3.DatabaseError as error:
            if disk_is_full(error):
                raise NoSpace from error
            raise RunError(
                f"{path} is no file of job records, or is damaged ({error}): move it away, and a "
                "new one is made; the results stay",
                file=str(path),
            ) from error
        self._database.execute("pragma journal_mode=wal")
        self._database.execute("pragma synchronous=normal")
        self.version = 0

    def add(self, job: Job) -> bool:
        """Add a record; returns False, and adds nothing, where its id or its key is taken."""
        values = [_stored(name, getattr(job, name)) for name in COLUMNS]
        columns = f"({', '.join(COLUMNS)}) values ({', '.join('?' * len(COLUMNS))})"
        return self._change(f"insert into jobs {columns} on conflict do nothing", values)

    def update(self, identity: str, **values: Any) -> bool:
        """Set some columns; returns False, and changes nothing, where the job has finished."""
        assignments = ", ".join(f"{name} = ?" for name in values)
        stored = [_stored(name, value) for name, value in values.items()]
        return self._change(
            f"update jobs set {assignments} where id = ? and state in ('queued', 'running')",
            [*stored, identity],
        )

    def reopen(self, identity: str) -> bool:
        """Queue a job again that ended without a result; returns False where it is open or done."""
        return self._change(
            "update jobs set state = 'queued', fraction = 0, text = 'waiting for its turn', "
            "started = null, finished = null, seconds = 0, error = null, result = null, "
            "attempt = attempt + 1 "
            "where id = ? and state in ('failed', 'cancelled', 'interrupted')",
            [identity],
        )

    def put_back(self, identity: str) -> bool:
        """Queue a running job again; returns False where it does not run."""
        return self._change(
            "update jobs set state = 'queued', fraction = 0, text = 'waiting for its turn', "
            "started = null, seconds = 0 where id = ? and state = 'running'",
            [identity],
        )

    def interrupt_running(self, message: str) -> None:
        """Mark every running record as interrupted; waiting ones stay."""
        for job in self._select("where state = 'running'", []):
            error = {"kind": "Interrupted", "message": message, "where": {}}
            if self.update(
                job.id,
                state=JobState.INTERRUPTED,
                error=error,
                finished=time.time(),
                text="interrupted",
            ):
                self.note(job.id, "error", message)

    def waiting(self) -> list[Job]:
        """Queued jobs, the oldest first."""
        return self._select("where state = 'queued' order by rowid", [])

    def by_key(self, key: str) -> Job | None:
        """The job of the request with this key."""
        return next(iter(self._select("where key = ?", [key])), None)

    def note(self, identity: str, level: str, text: str) -> None:
        """Add a line to a job's log."""
        self._change(
            "insert into log select ?, ?, ?, ? where (select count(*) from log where job = ?) < ?",
            [identity, time.time(), level, text, identity, MOST_NOTES],
        )

    def notes(self, identity: str, after: int = 0, most: int = 1000) -> list[Note]:
        """Lines of a job's log from the `after`-th on."""
        self.get(identity)
        with self._lock:
            rows = self._database.execute(
                "select at, level, text from log where job = ? order by rowid limit ? offset ?",
                [identity, most, after],
            ).fetchall()
        return [Note(*row) for row in rows]

    def get(self, identity: str) -> Job:
        """One job; raises Missing where there is none of this id."""
        for job in self._select("where id = ?", [identity]):
            return job
        raise Missing(f"there is no job {identity}", job=identity)

    def all(self, most: int = -1, after: int = 0) -> list[Job]:
        """Jobs, the newest first: at most `most` from the `after`-th on, or all."""
        return self._select("order by rowid desc limit ? offset ?", [most, after])

    def count(self) -> int:
        """Number of jobs."""
        with self._lock:
            return int(self._database.execute("select count(*) from jobs").fetchone()[0])

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._database.close()

    def _select(self, rest: str, values: list[Any]) -> list[Job]:
        with self._lock:
            rows = self._database.execute(
                f"select {', '.join(COLUMNS)} from jobs {rest}", values
            ).fetchall()
        return [_job(row) for row in rows]

    def _change(self, statement: str, values: list[Any]) -> bool:
        with self._lock:
            try:
                changed = self._database.execute(statement, values).rowcount
            except sqlite3.OperationalError as error:
                raise NoSpace if disk_is_full(error) else error from error
            self.version += 1
        return changed > 0


def _stored(name: str, value: Any) -> Any:
    return json.dumps(value) if name in JSON_COLUMNS and value is not None else value


def _job(row: tuple[Any, ...]) -> Job:
    values = dict(zip(COLUMNS, row, strict=True))
    for name in JSON_COLUMNS:
        values[name] = None if values[name] is None else _content(values[name])
    values["state"] = JobState(values["state"])
    return Job(**values)


def _content(text: str) -> Any:
    """The content of a JSON column; an empty object where it is damaged, so that the other jobs
    are still listed.
    """
    try:
        return json.loads(text)
    except ValueError:
        log.exception("a job's record is damaged")
        return {}


def _opened(path: Path) -> sqlite3.Connection:
    """Open the database, with its tables as of the present version."""
    database = sqlite3.connect(path, check_same_thread=False, isolation_level=None)
    try:
        _migrate(database, path)
    except BaseException:
        database.close()
        raise
    return database


def _migrate(database: sqlite3.Connection, path: Path) -> None:
    """Bring the tables to the present version."""
    (known,) = database.execute("pragma user_version").fetchone()
    there = {row[1] for row in database.execute("pragma table_info(jobs)")}
    if known > VERSION:
        raise RunError(
            f"{path} was written by a later Palpate (version {known} of the file; this one "
            f"reads up to {VERSION}): update Palpate, or name another folder of runs",
            file=str(path),
            value=known,
        )
    if known == VERSION:
        return
    if there:
        _back_up(database, path.with_name(f"{path.stem}-version-{known}{path.suffix}"))
    missing = [name for name in LATER if there and name not in there]
    added = [f"alter table jobs add column {name} {LATER[name]}" for name in missing]
    changes = [*SCHEMA, *added, KEYS, f"pragma user_version = {VERSION}"]
    database.executescript(f"begin; {'; '.join(changes)}; commit;")


def _back_up(database: sqlite3.Connection, path: Path) -> None:
    """Copy a database to a file, which appears once it is whole."""
    aside = path.with_name(f".{path.name}.part")
    aside.unlink(missing_ok=True)
    copy = sqlite3.connect(aside)
    try:
        database.backup(copy)
    finally:
        copy.close()
    os.replace(aside, path)
