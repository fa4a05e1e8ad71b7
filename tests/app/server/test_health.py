"""`/health` and the exit status, of a server whose job queue meets faults."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import sqlite3
import time
from pathlib import Path

import job_functions
import pytest
from launched_server import client_of, launched, until

from palpate.app.main import create_app
from palpate.app.server.serve import serve
from palpate.app.settings import Settings
from palpate.foundation.errors import SetupError


def fork_servers(pid: int) -> list[int]:
    found = []
    for child in job_functions.family(pid):
        with contextlib.suppress(OSError):
            if b"forkserver" in Path(f"/proc/{child}/cmdline").read_bytes():
                found.append(child)
    return found


def queue_job(place: Path, name: str) -> None:
    """Put a job into the table that a server finds at its start."""
    database = sqlite3.connect(place / "runs" / "jobs.sqlite")
    request = f'{{"steps": 1, "result": "{place / name}", "scratch": "{place / "runs" / name}"}}'
    with database:
        database.execute(
            "insert into jobs (id, kind, request, state, fraction, text, created) "
            "values (?, 'count', ?, 'queued', 0, '', 0)",
            [name, request],
        )
    database.close()


@pytest.mark.more
def test_server_whose_jobs_cannot_start_ends_with_a_status_and_keeps_them(tmp_path: Path) -> None:
    with launched(tmp_path) as process, client_of(tmp_path):
        process.send_signal(signal.SIGTERM)
        assert process.wait(30) == -signal.SIGTERM
    queue_job(tmp_path, "waits")
    with launched(tmp_path) as process:
        end = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < end:
            for one in fork_servers(process.pid):
                with contextlib.suppress(ProcessLookupError):
                    os.kill(one, signal.SIGKILL)
        assert process.wait(1) == 1
        assert process.stderr is not None
        assert "the job queue gives up: no process could be started" in process.stderr.read()
    with launched(tmp_path), client_of(tmp_path) as client:
        until(lambda: client.get("/api/jobs/waits").json()["state"] == "done")


def test_full_disk_at_the_start_is_told_before_any_address(tmp_path: Path) -> None:
    app = create_app(Settings(runs=tmp_path), job_functions.TARGETS)

    def full() -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    app.state.prepare = full
    told: list[str] = []
    with pytest.raises(SetupError, match="its disk is full"):
        serve(app, "127.0.0.1", 0, told.append)
    assert not told
