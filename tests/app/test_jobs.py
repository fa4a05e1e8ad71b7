from __future__ import annotations

import os
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from app.jobs import Jobs
from app.problems import Conflict, Missing
from app.records import Job, JobState

WORK = """
import os, pathlib, subprocess, sys, time
from core.errors import Cancelled, DatasetError

def count(request, report):
    for step in range(request["steps"]):
        report(step / request["steps"], f"step {step}")
        pathlib.Path(request["scratch"], f"{step}.part").write_text("half")
        time.sleep(request.get("pause", 0))
    os.rename(request["scratch"], request["result"])
    return {"steps": request["steps"]}

def sleep_with_child(request, report):
    child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    pathlib.Path(request["result"]).write_text(f"{os.getpid()} {child.pid}")
    report(0.5, "sleeping")
    time.sleep(60)

def refuse(request, report):
    raise DatasetError("touches.csv, row 3: nan", file="touches.csv", row=3)

def stumble(request, report):
    raise ZeroDivisionError("a bug")

def give_up(request, report):
    raise Cancelled

def die(request, report):
    os._exit(7)
"""
TARGETS = {name: f"job_work:{name}" for name in ("count", "sleep_with_child", "refuse", "stumble", "give_up", "die")}

Started = Callable[..., Job]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "job_work.py").write_text(WORK)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path / "runs"


@pytest.fixture
def jobs(folder: Path) -> Iterator[Jobs]:
    with closing(Jobs(folder, TARGETS)) as jobs:
        yield jobs


def ended(jobs: Jobs, job: Job) -> Job:
    return reached(jobs, job, lambda now: now.state.is_finished)


def reached(jobs: Jobs, job: Job, true: Callable[[Job], bool]) -> Job:
    end = time.monotonic() + 30
    while not true(now := jobs.get(job.id)):
        assert time.monotonic() < end, f"still {now}"
        time.sleep(0.02)
    return now


def alive(pid: int) -> bool:
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except OSError:
        return False
    return state != "Z"


def scratch_is_clean(folder: Path) -> bool:
    return not any((folder / ".making").glob("*"))


def test_job_runs_in_another_process_and_leaves_its_result(jobs: Jobs, tmp_path: Path, folder: Path) -> None:
    done = ended(jobs, jobs.submit("count", {"steps": 3, "result": str(tmp_path / "result")}, label="block"))
    assert (done.state, done.fraction, done.result) == (JobState.DONE, 1.0, {"steps": 3})
    assert done.id.startswith("block-")
    assert len(list((tmp_path / "result").iterdir())) == 3
    assert done.started is not None
    assert done.finished is not None
    assert done.created <= done.started <= done.finished


def test_progress_is_seen_while_the_job_runs(jobs: Jobs, tmp_path: Path) -> None:
    job = jobs.submit("count", {"steps": 50, "pause": 0.05, "result": str(tmp_path / "result")})
    now = reached(jobs, job, lambda now: now.fraction > 0.05)
    assert now.state is JobState.RUNNING
    assert now.text.startswith("step ")


def test_cancelled_job_ends_its_whole_family_and_leaves_nothing(jobs: Jobs, tmp_path: Path, folder: Path) -> None:
    job = jobs.submit("sleep_with_child", {"result": str(tmp_path / "pids")})
    reached(jobs, job, lambda now: now.fraction == 0.5)
    family = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    assert all(alive(pid) for pid in family)
    assert jobs.cancel(job.id).state is JobState.CANCELLED
    end = time.monotonic() + 10
    while (any(alive(pid) for pid in family) or not scratch_is_clean(folder)) and time.monotonic() < end:
        time.sleep(0.02)
    assert not any(alive(pid) for pid in family)
    assert scratch_is_clean(folder)
    with pytest.raises(Conflict, match="is cancelled already"):
        jobs.cancel(job.id)


def test_waiting_job_can_be_cancelled_before_it_starts(jobs: Jobs, tmp_path: Path) -> None:
    first = jobs.submit("count", {"steps": 10, "pause": 0.05, "result": str(tmp_path / "first")})
    second = jobs.submit("count", {"steps": 1, "result": str(tmp_path / "second")})
    assert jobs.get(second.id).state is JobState.QUEUED
    jobs.cancel(second.id)
    assert ended(jobs, first).state is JobState.DONE
    third = jobs.submit("count", {"steps": 1, "result": str(tmp_path / "third")})
    assert ended(jobs, third).state is JobState.DONE
    assert not (tmp_path / "second").exists()


def test_failed_job_keeps_its_error_with_its_place(jobs: Jobs, folder: Path) -> None:
    failed = ended(jobs, jobs.submit("refuse", {}))
    assert failed.state is JobState.FAILED
    assert failed.error == {
        "kind": "DatasetError",
        "message": "touches.csv, row 3: nan",
        "where": {"file": "touches.csv", "row": 3},
    }


@pytest.mark.parametrize(
    ("kind", "error"),
    [("stumble", "InternalError: ZeroDivisionError: a bug"), ("die", "WorkerDied: the worker process ended with code 7")],
)
def test_bug_and_sudden_death_are_told(jobs: Jobs, kind: str, error: str) -> None:
    failed = ended(jobs, jobs.submit(kind, {}))
    assert failed.state is JobState.FAILED
    assert failed.error is not None
    assert f"{failed.error['kind']}: {failed.error['message']}" == error


def test_work_that_gives_up_is_cancelled(jobs: Jobs) -> None:
    assert ended(jobs, jobs.submit("give_up", {})).state is JobState.CANCELLED


def test_after_a_restart_open_jobs_are_failed_and_half_results_gone(folder: Path) -> None:
    with closing(Jobs(folder, TARGETS)):
        pass
    (folder / ".making" / "old").mkdir(parents=True)
    with closing(sqlite3.connect(folder / "jobs.sqlite")) as database, database:
        for identity, state in (("ran", "running"), ("waited", "queued"), ("ended", "done")):
            row = (identity, "count", "{}", state, 0.5, "half way", 1.0)
            database.execute(
                "insert into jobs (id, kind, request, state, fraction, text, created) values (?, ?, ?, ?, ?, ?, ?)", row
            )
    with closing(Jobs(folder, TARGETS)) as jobs:
        assert [jobs.get(name).state.value for name in ("ran", "waited", "ended")] == ["failed", "failed", "done"]
        assert "start it again" in (jobs.get("ran").error or {})["message"]
        assert scratch_is_clean(folder)


def test_closing_ends_what_runs(folder: Path, tmp_path: Path) -> None:
    with closing(Jobs(folder, TARGETS)) as jobs:
        job = jobs.submit("sleep_with_child", {"result": str(tmp_path / "pids")})
        reached(jobs, job, lambda now: now.fraction == 0.5)
    family = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    end = time.monotonic() + 10
    while any(alive(pid) for pid in family) and time.monotonic() < end:
        time.sleep(0.02)
    assert not any(alive(pid) for pid in family)
    assert os.getpid() not in family


def test_unknown_job_is_missing(jobs: Jobs) -> None:
    with pytest.raises(Missing, match="there is no job x"):
        jobs.get("x")


def test_every_change_is_noticed(jobs: Jobs, tmp_path: Path) -> None:
    seen: list[Any] = [jobs.version]
    job = jobs.submit("count", {"steps": 2, "result": str(tmp_path / "result")})
    seen.append(jobs.version)
    ended(jobs, job)
    seen.append(jobs.version)
    assert seen[0] < seen[1] < seen[2]
