"""Faults that must not end the queue: a killed fork server, a full disk, an error of its own."""

from __future__ import annotations

import os
import resource
import signal
import socket
import sqlite3
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from multiprocessing import forkserver
from pathlib import Path

import pytest
from job_functions import TARGETS, ended, reached

from palpate.app.http_errors import NoSpace
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import Job, JobState
from palpate.foundation.errors import RunError


@pytest.fixture
def jobs(tmp_path: Path) -> Iterator[JobQueue]:
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        yield jobs


def fork_server() -> int:
    forkserver.ensure_running()
    return int(vars(forkserver)["_forkserver"]._forkserver_pid)


@contextmanager
def refusing(place: Path) -> Iterator[None]:
    """Let the fork server refuse connections in the block, as one that is just ending does."""
    server = vars(forkserver)["_forkserver"]
    address = server._forkserver_address
    with socket.socket(socket.AF_UNIX) as closed:
        closed.bind(str(place / "closed"))
    server._forkserver_address = str(place / "closed")
    try:
        yield
    finally:
        server._forkserver_address = address


def count(jobs: JobQueue, tmp_path: Path, name: str) -> str:
    return jobs.submit("count", {"steps": 2, "result": str(tmp_path / name)}).id


def test_fork_server_that_is_killed_while_a_job_starts(jobs: JobQueue, tmp_path: Path) -> None:
    server = fork_server()
    os.kill(server, signal.SIGSTOP)
    first = count(jobs, tmp_path, "first")
    time.sleep(0.5)
    os.kill(server, signal.SIGKILL)
    second = count(jobs, tmp_path, "second")
    for name in (first, second):
        assert ended(jobs, jobs.get(name)).state is JobState.DONE
    assert any("started again" in note.text for note in jobs.notes(first))


def test_fork_server_that_still_dies_is_given_time(jobs: JobQueue, tmp_path: Path) -> None:
    """A killed process refuses connections for a while before it counts as ended."""
    fork_server()
    with refusing(tmp_path):
        job = count(jobs, tmp_path, "one")
        reached(jobs, jobs.get(job), lambda _: len(jobs.notes(job)) >= 2)
    assert ended(jobs, jobs.get(job)).state is JobState.DONE
    assert any("ConnectionRefusedError" in note.text for note in jobs.notes(job))


def test_full_disk_refuses_new_work_and_loses_none(jobs: JobQueue, tmp_path: Path) -> None:
    running = jobs.submit("count", {"steps": 20, "pause": 0.1, "result": str(tmp_path / "one")})
    waiting = count(jobs, tmp_path, "two")
    reached(jobs, running, lambda now: now.state is JobState.RUNNING)
    database: sqlite3.Connection = jobs._records._database
    pages = database.execute("pragma page_count").fetchone()[0]
    database.execute(f"pragma max_page_count = {pages}")
    accepted: list[str] = []
    with pytest.raises(NoSpace, match="empty the caches"):
        for _ in range(200):
            accepted.append(count(jobs, tmp_path, f"more-{len(accepted)}"))
    for size in (1000, 100, 10, 1):  # no room is left for the note of the next job either
        with pytest.raises(NoSpace):
            for _ in range(1000):
                jobs._records.note(waiting, "info", "x" * size)
    reached(jobs, running, lambda _: bool(jobs.trouble))
    database.execute("pragma max_page_count = 100000")
    for name in (running.id, waiting, *accepted):
        assert ended(jobs, jobs.get(name)).state is JobState.DONE
    assert not jobs.trouble


def test_work_that_finds_no_room_says_what_to_free(jobs: JobQueue, tmp_path: Path) -> None:
    """/dev/full answers every write as a full disk does."""
    (tmp_path / "full.pid").symlink_to("/dev/full")
    job = jobs.submit("count", {"steps": 1, "result": str(tmp_path / "full")})
    failed = ended(jobs, job)
    assert (failed.state, (failed.error or {})["kind"]) == (JobState.FAILED, "NoSpace")
    (tmp_path / "full.pid").unlink()
    jobs.retry(job.id)
    assert ended(jobs, job).state is JobState.DONE


def test_error_of_the_queue_puts_the_job_back_once(jobs: JobQueue, tmp_path: Path) -> None:
    database: sqlite3.Connection = jobs._records._database
    database.execute(
        "create trigger broken before insert on log begin select raise(fail, 'x'); end"
    )
    first = count(jobs, tmp_path, "first")
    end = time.monotonic() + 20
    while not jobs.trouble and time.monotonic() < end:
        time.sleep(0.001)
    database.execute("drop trigger broken")
    assert "was started again" in jobs.trouble
    assert ended(jobs, jobs.get(first)).state is JobState.DONE
    second = count(jobs, tmp_path, "second")
    assert ended(jobs, jobs.get(second)).state is JobState.DONE
    assert not jobs.trouble


def test_queue_outlives_jobs_that_it_cannot_run(
    jobs: JobQueue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = jobs._runner.run

    def failing(job: Job) -> None:
        if "bad" in job.request["result"]:
            raise RuntimeError("this job stops the queue")
        run(job)

    monkeypatch.setattr(jobs._runner, "run", failing)
    bad = [count(jobs, tmp_path, f"bad-{number}") for number in range(3)]
    good = count(jobs, tmp_path, "good")
    assert ended(jobs, jobs.get(good)).state is JobState.DONE
    for identity in bad:
        failed = ended(jobs, jobs.get(identity))
        assert failed.state is JobState.FAILED and "stops the queue" in str(failed.error)
    assert ended(jobs, jobs.get(count(jobs, tmp_path, "later"))).state is JobState.DONE
    assert not jobs.trouble


def test_queue_that_cannot_start_processes_gives_up_aloud(tmp_path: Path) -> None:
    told: list[str] = []
    with closing(JobQueue(tmp_path / "runs", TARGETS, failed=told.append)) as jobs:
        fork_server()
        with refusing(tmp_path):
            job = count(jobs, tmp_path, "never")
            end = time.monotonic() + 30
            while not told and time.monotonic() < end:
                time.sleep(0.02)
        assert len(told) == 1 and "in 4 attempts (ConnectionRefusedError" in told[0]
        assert told[0].endswith(jobs.trouble)
        assert jobs.get(job).state is JobState.QUEUED
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        assert ended(jobs, jobs.get(job)).state is JobState.DONE


def test_queue_waits_while_no_more_files_can_be_opened(jobs: JobQueue, tmp_path: Path) -> None:
    usual = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (3, usual[1]))
    try:
        job = count(jobs, tmp_path, "later")
        end = time.monotonic() + 20
        while "too many open files" not in jobs.trouble and time.monotonic() < end:
            time.sleep(0.02)
        time.sleep(8.0)  # longer than all pauses of a fork server that ended
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, usual)
    assert ended(jobs, jobs.get(job)).state is JobState.DONE
    assert not jobs.trouble


def test_folder_that_is_moved_away_takes_no_new_work(jobs: JobQueue, tmp_path: Path) -> None:
    assert not jobs.trouble
    (tmp_path / "runs").rename(tmp_path / "moved")
    (tmp_path / "runs").mkdir()
    assert "was moved, replaced or deleted" in jobs.trouble
    with pytest.raises(RunError, match="put it back, or restart"):
        count(jobs, tmp_path, "lost")
    (tmp_path / "runs").rmdir()
    (tmp_path / "moved").rename(tmp_path / "runs")
    assert not jobs.trouble
    assert ended(jobs, jobs.get(count(jobs, tmp_path, "kept"))).state is JobState.DONE
