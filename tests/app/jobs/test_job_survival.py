"""What waits outlives the server, what ran is told to have been interrupted, and both can be had
after all.
"""

from __future__ import annotations

import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import job_functions
import pytest
from job_functions import TARGETS, ended, gone, reached, scratch_is_clean

from palpate.app.http_errors import Conflict
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import JobState
from palpate.foundation.errors import SetupError

SERVER = """
import pathlib, sys, time
from palpate.app.jobs.job_queue import JobQueue
from job_functions import TARGETS
if __name__ == "__main__":
    folder, kept = map(pathlib.Path, sys.argv[1:])
    jobs = JobQueue(folder, TARGETS)
    done = jobs.submit("count", {"steps": 1, "result": str(kept / "first")}, label="first")
    while not jobs.get(done.id).state.is_finished:
        time.sleep(0.02)
    jobs.submit("sleep_with_child", {"result": str(kept / "pids")}, label="ran")
    jobs.submit("count", {"steps": 2, "result": str(kept / "second")}, label="waited")
    time.sleep(600)
"""


@contextmanager
def server(tmp_path: Path) -> Iterator[subprocess.Popen[bytes]]:
    (tmp_path / "serving.py").write_text(SERVER)
    tests = Path(job_functions.__file__).parent
    searched = os.pathsep.join(str(path) for path in (tests.parent, tests))
    command = [sys.executable, str(tmp_path / "serving.py"), str(tmp_path / "runs"), str(tmp_path)]
    with subprocess.Popen(command, env=os.environ | {"PYTHONPATH": searched}) as process:
        yield process
        process.kill()


def written(path: Path) -> str:
    end = time.monotonic() + 120
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < end
        time.sleep(0.02)
    return path.read_text()


def test_server_that_is_killed_leaves_no_process_and_loses_no_job(tmp_path: Path) -> None:
    with server(tmp_path) as process:
        family = [int(pid) for pid in written(tmp_path / "pids").split()]
        process.kill()
        process.wait()
        assert gone(family)
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        waited, ran, first = jobs.all()
        assert (first.state, first.result) == (JobState.DONE, {"steps": 1})
        assert (ran.state, (ran.error or {})["kind"]) == (JobState.INTERRUPTED, "Interrupted")
        assert ended(jobs, waited).state is JobState.DONE
        assert len(list((tmp_path / "second").iterdir())) == 2
        assert jobs.notes(ran.id)[-1].level == "error"


def test_worker_that_is_killed_is_told_and_retried_under_the_same_name(tmp_path: Path) -> None:
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        job = jobs.submit("count", {"steps": 40, "pause": 0.05, "result": str(tmp_path / "result")})
        reached(jobs, job, lambda now: now.fraction > 0.1)
        os.kill(int(written(tmp_path / "result.pid")), signal.SIGKILL)
        killed = ended(jobs, job)
        assert (killed.state, (killed.error or {})["kind"]) == (JobState.INTERRUPTED, "WorkerDied")
        assert "SIGKILL" in (killed.error or {})["message"]
        assert not (tmp_path / "result").exists()
        again = jobs.retry(job.id)
        assert (again.id, again.attempt, again.error) == (job.id, 2, None)
        assert ended(jobs, job).state is JobState.DONE
        assert len(list((tmp_path / "result").iterdir())) == 40
        with pytest.raises(Conflict, match="is done: there is nothing to retry"):
            jobs.retry(job.id)
    assert scratch_is_clean(tmp_path / "runs")


def test_a_job_that_was_just_cancelled_can_be_retried_at_once(tmp_path: Path) -> None:
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        job = jobs.submit("count", {"steps": 20, "pause": 0.05, "result": str(tmp_path / "result")})
        reached(jobs, job, lambda now: now.fraction > 0.1)
        jobs.cancel(job.id)
        jobs.retry(job.id)
        assert ended(jobs, job).state is JobState.DONE


def test_log_has_each_stage_once_and_every_warning(tmp_path: Path) -> None:
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        job = ended(jobs, jobs.submit("warn", {}))
        told = [(note.level, note.text) for note in jobs.notes(job.id)]
        assert [text for level, text in told if level == "info"] == [
            "started, attempt 1",
            "frame 0 of 30",
            "writing",
            "done",
        ]
        assert [("cloud 7 is dark" in text) for level, text in told if level == "warning"] == [True]
        assert [note.text for note in jobs.notes(job.id, after=len(told) - 1)] == ["done"]


def test_the_same_request_under_the_same_key_is_one_job(tmp_path: Path) -> None:
    with closing(JobQueue(tmp_path / "runs", TARGETS)) as jobs:
        job = jobs.submit("warn", {"of": 1}, key="mine")
        assert jobs.submit("warn", {"of": 1}, key="mine").id == job.id
        assert jobs.submit("warn", {"of": 1}).id != job.id
        with pytest.raises(Conflict, match="another request's"):
            jobs.submit("warn", {"of": 2}, key="mine")


def test_two_servers_do_not_share_a_folder(tmp_path: Path) -> None:
    with (
        closing(JobQueue(tmp_path, TARGETS)),
        pytest.raises(SetupError, match="another server works in"),
    ):
        JobQueue(tmp_path, TARGETS)
    with closing(JobQueue(tmp_path, TARGETS)):
        pass


def test_records_of_an_earlier_version_are_read_and_what_ran_then_is_interrupted(
    tmp_path: Path,
) -> None:
    with closing(sqlite3.connect(tmp_path / "jobs.sqlite")) as database, database:
        database.execute(
            "create table jobs (id text primary key, kind text not null, request text not null, "
            "state text not null, "
            "fraction real not null, text text not null, created real not null, started real, "
            "finished real, "
            "error text, result text)"
        )
        for identity, state in (("ran", "running"), ("ended", "done")):
            row = (identity, "count", "{}", state, 0.5, "half way", 1.0)
            database.execute(
                "insert into jobs (id, kind, request, state, fraction, text, created) "
                "values (?, ?, ?, ?, ?, ?, ?)",
                row,
            )
    (tmp_path / ".making" / "old").mkdir(parents=True)
    with closing(JobQueue(tmp_path, TARGETS)) as jobs:
        found: list[Any] = [jobs.get(name) for name in ("ran", "ended")]
        assert [(job.state.value, job.attempt) for job in found] == [
            ("interrupted", 1),
            ("done", 1),
        ]
        assert "retry it" in (found[0].error or {})["message"]
        assert scratch_is_clean(tmp_path)
