"""`/health` and the exit status, of a server whose job queue meets faults."""

from __future__ import annotations

import contextlib
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import job_functions
import pytest

SERVER = """
import pathlib, sys
from palpate.app.main import create_app
from palpate.app.server.serve import serve
from palpate.app.settings import Settings
from job_functions import TARGETS
if __name__ == "__main__":
    place = pathlib.Path(sys.argv[1])
    settings = Settings(runs=place / "runs", datasets=place / "datasets", preload=())
    app = create_app(settings, TARGETS)
    def started(address):
        (place / "address.part").write_text(address)
        (place / "address.part").rename(place / "address")
    serve(app, "127.0.0.1", 0, started)
"""


@contextmanager
def launched(place: Path) -> Iterator[subprocess.Popen[str]]:
    """A server that writes its address into a file."""
    (place / "address").unlink(missing_ok=True)
    (place / "serving.py").write_text(SERVER)
    tests = Path(job_functions.__file__).parent
    searched = os.pathsep.join(str(path) for path in (tests.parent, tests))
    with subprocess.Popen(
        [sys.executable, str(place / "serving.py"), str(place)],
        env=os.environ | {"PYTHONPATH": searched},
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        yield process
        process.kill()


@contextmanager
def client_of(place: Path) -> Iterator[httpx.Client]:
    until((place / "address").exists)
    with httpx.Client(base_url=(place / "address").read_text(), timeout=30) as client:
        until(lambda: client.get("/health").json() == {"status": "ok"})
        yield client


def until(true: Any, seconds: float = 60.0) -> None:
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


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
