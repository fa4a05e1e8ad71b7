from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from job_functions import TARGETS, alive, ended, reached, scratch_is_clean

from palpate.app.http_errors import Conflict, Missing, NoSpace
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import JobState
from palpate.app.storage.result_store import NAME

_LOST = (
    "a process that this job had started was ended from outside (killed, or out of memory): retry "
    "the job"
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "runs"


@pytest.fixture
def jobs(folder: Path) -> Iterator[JobQueue]:
    with closing(JobQueue(folder, TARGETS)) as jobs:
        yield jobs


def test_job_runs_in_another_process_and_leaves_its_result(
    jobs: JobQueue, tmp_path: Path, folder: Path
) -> None:
    done = ended(
        jobs, jobs.submit("count", {"steps": 3, "result": str(tmp_path / "result")}, label="block")
    )
    assert (done.state, done.fraction, done.result) == (JobState.DONE, 1.0, {"steps": 3})
    assert done.id.startswith("block-")
    assert len(list((tmp_path / "result").iterdir())) == 3
    assert done.started is not None
    assert done.finished is not None
    assert done.created <= done.started <= done.finished


def test_progress_is_seen_while_the_job_runs(jobs: JobQueue, tmp_path: Path) -> None:
    job = jobs.submit("count", {"steps": 50, "pause": 0.05, "result": str(tmp_path / "result")})
    now = reached(jobs, job, lambda now: now.fraction > 0.05)
    assert now.state is JobState.RUNNING
    assert now.text.startswith("step ")


def test_cancelled_job_ends_its_whole_family_and_leaves_nothing(
    jobs: JobQueue, tmp_path: Path, folder: Path
) -> None:
    job = jobs.submit("sleep_with_child", {"result": str(tmp_path / "pids")})
    reached(jobs, job, lambda now: now.fraction == 0.5)
    family = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    assert all(alive(pid) for pid in family)
    assert jobs.cancel(job.id).state is JobState.CANCELLED
    end = time.monotonic() + 10
    while (
        any(alive(pid) for pid in family) or not scratch_is_clean(folder)
    ) and time.monotonic() < end:
        time.sleep(0.02)
    assert not any(alive(pid) for pid in family)
    assert scratch_is_clean(folder)
    with pytest.raises(Conflict, match="is cancelled already"):
        jobs.cancel(job.id)


def test_waiting_job_can_be_cancelled_before_it_starts(jobs: JobQueue, tmp_path: Path) -> None:
    first = jobs.submit("count", {"steps": 10, "pause": 0.05, "result": str(tmp_path / "first")})
    second = jobs.submit("count", {"steps": 1, "result": str(tmp_path / "second")})
    assert jobs.get(second.id).state is JobState.QUEUED
    jobs.cancel(second.id)
    assert ended(jobs, first).state is JobState.DONE
    third = jobs.submit("count", {"steps": 1, "result": str(tmp_path / "third")})
    assert ended(jobs, third).state is JobState.DONE
    assert not (tmp_path / "second").exists()


def test_failed_job_keeps_its_error_with_its_place(jobs: JobQueue, folder: Path) -> None:
    failed = ended(jobs, jobs.submit("refuse", {}))
    assert failed.state is JobState.FAILED
    assert failed.error == {
        "kind": "DatasetError",
        "message": "touches.csv, row 3: nan",
        "where": {"file": "touches.csv", "row": 3},
    }


@pytest.mark.parametrize(
    ("kind", "error"),
    [
        ("stumble", "InternalError: ZeroDivisionError: a bug"),
        ("lose", "RunError: " + _LOST),
        ("die", "WorkerDied: the worker process ended with code 7"),
    ],
)
def test_bug_and_sudden_death_are_told(jobs: JobQueue, kind: str, error: str) -> None:
    failed = ended(jobs, jobs.submit(kind, {}))
    assert failed.state is JobState.FAILED
    assert failed.error is not None
    assert f"{failed.error['kind']}: {failed.error['message']}" == error


def test_work_that_gives_up_is_cancelled(jobs: JobQueue) -> None:
    assert ended(jobs, jobs.submit("give_up", {})).state is JobState.CANCELLED


def test_closing_interrupts_what_runs(folder: Path, tmp_path: Path) -> None:
    with closing(JobQueue(folder, TARGETS)) as jobs:
        job = jobs.submit("sleep_with_child", {"result": str(tmp_path / "pids")})
        reached(jobs, job, lambda now: now.fraction == 0.5)
    family = [int(pid) for pid in (tmp_path / "pids").read_text().split()]
    end = time.monotonic() + 10
    while any(alive(pid) for pid in family) and time.monotonic() < end:
        time.sleep(0.02)
    assert not any(alive(pid) for pid in family)
    assert os.getpid() not in family


def test_unknown_job_is_missing(jobs: JobQueue) -> None:
    with pytest.raises(Missing, match="there is no job x"):
        jobs.get("x")


def test_every_change_is_noticed(jobs: JobQueue, tmp_path: Path) -> None:
    seen: list[Any] = [jobs.version]
    job = jobs.submit("count", {"steps": 2, "result": str(tmp_path / "result")})
    seen.append(jobs.version)
    ended(jobs, job)
    seen.append(jobs.version)
    assert seen[0] < seen[1] < seen[2]


def test_what_a_killed_job_made_beside_the_others_is_gone_and_it_is_done_once_more(
    tmp_path: Path,
) -> None:
    beside = tmp_path / "datasets" / ".importing"
    (beside / "of-an-earlier-server").mkdir(parents=True)
    with closing(
        JobQueue(tmp_path / "runs", TARGETS, beside=[beside], tidy=lambda jobs: "made room")
    ) as jobs:
        assert not list(beside.iterdir())
        job = ended(
            jobs, jobs.submit("litter", {"beside": str(beside), "again": str(tmp_path / "again")})
        )
        assert job.state is JobState.INTERRUPTED
        assert not list(beside.iterdir()) and scratch_is_clean(tmp_path / "runs")
        jobs.retry(job.id)
        assert ended(jobs, job).state is JobState.DONE
        assert not list(beside.iterdir())
        assert [note.text for note in jobs.notes(job.id)].count("made room") == 2


def test_ids_that_would_collide_do_not(
    jobs: JobQueue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Two requests of one second that draw the same characters are two jobs."""
    drawn = iter(["00aa00aa", "00aa00aa", "11bb11bb"])
    monkeypatch.setattr("palpate.app.jobs.job_queue.secrets.token_hex", lambda _: next(drawn))
    monkeypatch.setattr("palpate.app.jobs.job_queue.time.strftime", lambda _: "20260101-000000")
    made = [jobs.submit("count", {"steps": 1, "result": str(tmp_path / name)}) for name in "ab"]
    assert [job.id[-8:] for job in made] == ["00aa00aa", "11bb11bb"]
    assert {ended(jobs, job).state for job in made} == {JobState.DONE}
    assert len(list(tmp_path.glob("[ab]"))) == 2


def test_id_of_a_long_label_is_a_name_also_after_another_label(jobs: JobQueue) -> None:
    first = jobs.submit("count", {}, "x" * 200)
    second = jobs.submit("count", {}, f"export-{first.id}")
    assert NAME.fullmatch(second.id) and first.id != second.id


def test_clock_that_is_set_back_changes_no_duration(
    jobs: JobQueue, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real, back = time.time, iter(range(0, 100_000, 100))
    monkeypatch.setattr("time.time", lambda: real() - next(back))
    job = jobs.submit("count", {"steps": 40, "pause": 0.05, "result": str(tmp_path / "result")})
    running = reached(jobs, job, lambda now: now.fraction > 0.3)
    assert running.remaining is not None and 0.1 < running.remaining < 60
    done = ended(jobs, job)
    assert 1.5 < done.seconds < 60
    later = jobs.submit("count", {"steps": 1, "result": str(tmp_path / "later")})
    assert [one.id for one in jobs.all()] == [later.id, job.id]
    ended(jobs, later)


def test_request_that_is_repeated_is_the_known_job_also_where_new_ones_are_refused(
    tmp_path: Path, folder: Path
) -> None:
    refused = False

    def admit() -> None:
        if refused:
            raise NoSpace("the results take more than they may")

    asked = {"steps": 1, "result": str(tmp_path / "result")}
    with closing(JobQueue(folder, TARGETS, admit=admit)) as jobs:
        first = jobs.submit("count", asked, key="once")
        refused = True
        assert jobs.submit("count", asked, key="once").id == first.id
        for key in (None, "another"):
            with pytest.raises(NoSpace):
                jobs.submit("count", asked, key=key)
        assert len(jobs.all()) == 1
