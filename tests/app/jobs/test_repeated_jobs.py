"""Jobs that were interrupted after their result was in place, and before that was recorded."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from job_functions import TARGETS, ended
from small_dataset import write_valid_dataset

from palpate.app.jobs import import_dataset as importing
from palpate.app.jobs.job_queue import JobQueue
from palpate.app.jobs.job_records import JobState
from palpate.app.jobs.short_tasks import export, replay
from palpate.app.jobs.tasks import diagnose
from palpate.foundation.errors import DatasetError
from palpate.foundation.progress import silent


class Killed(BaseException):
    """Stands for the end of a process: nothing catches it."""


@pytest.fixture
def request_of(tmp_path: Path) -> Callable[[str], dict[str, Any]]:
    """Makes the request of an import with this id; each has an archive of its own."""
    write_valid_dataset(tmp_path / "block")

    def make(identity: str) -> dict[str, Any]:
        archive = shutil.make_archive(str(tmp_path / identity), "zip", tmp_path, "block")
        return {
            "datasets": str(tmp_path / "datasets"),
            "name": "mine",
            "scratch": str(tmp_path / "runs" / ".making" / identity),
            "archive": archive,
            "most": 2**30,
        }

    return make


def _killed_after_placing(monkeypatch: pytest.MonkeyPatch, request: dict[str, Any]) -> None:
    rename = os.rename

    def die(*places: Any) -> None:
        rename(*places)
        raise Killed

    with monkeypatch.context() as patched:
        patched.setattr(os, "rename", die)
        with pytest.raises(Killed):
            importing.import_dataset(request, silent)


def test_import_that_was_interrupted_after_placing_its_dataset_is_done_when_repeated(
    request_of: Callable[[str], dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    request = request_of("one")
    _killed_after_placing(monkeypatch, request)
    result = importing.import_dataset(request, silent)
    assert result["dataset"] == "mine" and result["sequences"] > 0
    assert not Path(request["archive"]).exists()
    assert importing.import_dataset(request, silent) == result, "the archive is gone by now"


def test_dataset_of_another_import_is_not_taken_for_the_own_one(
    request_of: Callable[[str], dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    request = request_of("one")
    _killed_after_placing(monkeypatch, request)
    placed = Path(request["datasets"]) / "mine"
    with pytest.raises(DatasetError, match="there is a dataset mine already"):
        importing.import_dataset(request_of("two"), silent)
    placed.rename(placed.with_name("away"))
    shutil.copytree(placed.with_name("away"), placed)
    with pytest.raises(DatasetError, match="there is a dataset mine already"):
        importing.import_dataset(request, silent)


def test_diagnosis_whose_run_is_in_place_returns_it(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "some-id"
    run.mkdir(parents=True)
    (run / "report.json").write_text('{"verdict": "none"}')
    request = {"runs": str(run.parent), "scratch": str(tmp_path / ".making" / "some-id")}
    assert diagnose(request, silent) == {"run": "some-id", "verdict": "none"}


def test_replay_whose_run_is_in_place_returns_it(tmp_path: Path) -> None:
    run = tmp_path / "runs" / "some-id"
    run.mkdir(parents=True)
    (run / "origin.json").write_text('{"unsolved": 3}')
    request = {"runs": str(run.parent), "scratch": str(tmp_path / ".making" / "some-id")}
    assert replay(request, silent) == {"run": "some-id", "frames_without_equilibrium": 3}


def test_notes_of_a_job_are_deleted_when_it_is_done(tmp_path: Path) -> None:
    place = tmp_path / "beside"
    place.mkdir()
    (other := place / "other-id.placed").touch()
    with closing(JobQueue(tmp_path / "runs", TARGETS, beside=[place])) as jobs:
        job = jobs.submit("count", {"steps": 3, "result": str(tmp_path / "result")})
        (note := place / f"{job.id}.placed").touch()
        assert ended(jobs, job).state is JobState.DONE
        end = time.monotonic() + 60
        while note.exists():
            assert time.monotonic() < end
            time.sleep(0.02)
    assert other.exists()


def test_export_whose_files_are_in_place_returns_them(tmp_path: Path) -> None:
    folder = tmp_path / "exports" / "some-id"
    folder.mkdir(parents=True)
    (folder / "report.html").write_text("")
    request = {"runs": str(tmp_path), "scratch": str(tmp_path / ".making" / "some-id")}
    assert export(request, silent) == {"export": "some-id", "files": ["report.html"]}
